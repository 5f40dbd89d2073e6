//! Initial values of a model's parameters; equal seeds give equal values on every machine.

use super::parameter::Param;
use crate::engine::Tensor;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Makes parameters one after the other.
pub struct Init {
    /// Draws values; without it all are 0.
    rng: Option<ChaCha8Rng>,
}

impl Init {
    /// Starts a model of values drawn by chance, or of zeros where there is no seed.
    pub fn new(seed: Option<u64>) -> Self {
        Self {
            rng: seed.map(ChaCha8Rng::seed_from_u64),
        }
    }

    /// Normally distributed values.
    pub fn normal(&mut self, shape: &[usize], std: f32) -> Param {
        self.drawn(shape, |rng| {
            // Box & Muller 1958.
            let radius = (-2.0 * (1.0 - rng.random::<f32>()).ln()).sqrt();
            std * radius * (std::f32::consts::TAU * rng.random::<f32>()).cos()
        })
    }

    /// Values spread evenly over -bound to bound.
    pub fn uniform(&mut self, shape: &[usize], bound: f32) -> Param {
        self.drawn(shape, |rng| bound * (2.0 * rng.random::<f32>() - 1.0))
    }

    fn drawn(&mut self, shape: &[usize], draw: impl Fn(&mut ChaCha8Rng) -> f32) -> Param {
        match &mut self.rng {
            Some(rng) => {
                let values: Vec<f32> = (0..shape.iter().product()).map(|_| draw(rng)).collect();
                learnt(Tensor::new(shape, values))
            }
            None => constant(shape, 0.0),
        }
    }
}

/// A learnt parameter of this shape, of which all elements have this value.
pub fn constant(shape: &[usize], value: f32) -> Param {
    learnt(Tensor::new(shape, vec![value; shape.iter().product()]))
}

fn learnt(tensor: Tensor) -> Param {
    Param {
        tensor,
        is_fixed: false,
    }
}
