//! First values of a model's parameters, the same for the same seed on every machine.

use burn::module::{Param, ParamId};
use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Makes parameters one after the other, numbering them.
pub struct Init<'a, B: Backend> {
    /// Draws values; without it all are 0.
    rng: Option<ChaCha8Rng>,
    made: u64,
    device: &'a B::Device,
}

impl<'a, B: Backend> Init<'a, B> {
    /// Starts a model of values drawn by chance, or of zeros where there is no seed.
    pub fn new(seed: Option<u64>, device: &'a B::Device) -> Self {
        Self {
            rng: seed.map(ChaCha8Rng::seed_from_u64),
            made: 0,
            device,
        }
    }

    /// Normally distributed values.
    pub fn normal<const D: usize>(&mut self, shape: [usize; D], std: f32) -> Param<Tensor<B, D>> {
        self.drawn(shape, |rng| {
            // Box & Muller 1958.
            let radius = (-2.0 * (1.0 - rng.random::<f32>()).ln()).sqrt();
            std * radius * (std::f32::consts::TAU * rng.random::<f32>()).cos()
        })
    }

    /// Values spread evenly over -bound to bound.
    pub fn uniform<const D: usize>(&mut self, shape: [usize; D], bound: f32) -> Param<Tensor<B, D>> {
        self.drawn(shape, |rng| bound * (2.0 * rng.random::<f32>() - 1.0))
    }

    /// The same value everywhere.
    pub fn constant<const D: usize>(&mut self, shape: [usize; D], value: f32) -> Param<Tensor<B, D>> {
        self.values(shape, vec![value; shape.iter().product()])
    }

    fn drawn<const D: usize>(
        &mut self,
        shape: [usize; D],
        draw: impl Fn(&mut ChaCha8Rng) -> f32,
    ) -> Param<Tensor<B, D>> {
        let count = shape.iter().product();
        let values = match &mut self.rng {
            Some(rng) => (0..count).map(|_| draw(rng)).collect(),
            None => vec![0.0; count],
        };
        self.values(shape, values)
    }

    fn values<const D: usize>(&mut self, shape: [usize; D], values: Vec<f32>) -> Param<Tensor<B, D>> {
        self.made += 1;
        let tensor = Tensor::from_data(TensorData::new(values, shape), self.device);
        Param::initialized(ParamId::from(self.made), tensor.require_grad())
    }
}
