//! What the motions may have smoothed: an average over all bulges.
//!
//! The field of motions smooths a zone that moves more than the rest of the wall, and its covariance does not allow for
//! that. What the observations show of a bulge beyond the motions says how much may be missing. The amplitude of each
//! bulge in each direction has a normal prior about zero, with the variance that makes the observations most likely:
//! with z, what is missing in standard deviations, and |z| > 1, the Bayes factor is exp((z^2 - 1) / 2) / |z| (Edwards,
//! Lindman & Savage 1963) and the mean square of the amplitude is z^2 - 1 times its variance. In advance, it is as
//! probable that none is missing as that one of them is. The covariances are averages over all of them (Hoeting et al.
//! 1999).

use super::body::Body;
use super::bulge::{Bulge, add_squares};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// A bulge in one direction.
struct Missing {
    /// Logarithm of the Bayes factor against none.
    log_factor: f64,
    /// Mean square of the amplitude, m^2.
    square: f64,
}

impl Missing {
    /// `z`: what is missing, in standard deviations. `sd_m`: of the amplitude.
    fn new(z: f64, sd_m: f64) -> Self {
        let size = z.abs().max(1.0);
        Self {
            log_factor: 0.5 * (size * size - 1.0) - size.ln(),
            square: (size * size - 1.0) * sd_m * sd_m,
        }
    }
}

/// Covariance of what may be missing in the motion of each stone, world, m^2.
///
/// `beyond`: what the observations show of each stone beyond its motion, less a rigid motion, in its frame.
pub(super) fn smoothed(body: &Body, bulges: &[Bulge], beyond: &[Vector3<f64>]) -> Vec<Matrix3<f64>> {
    let of_bulge = |bulge: &Bulge| {
        let scores = bulge.scores(beyond);
        let missing = |k: usize| {
            let direction = bulge.directions[k].as_ref()?;
            Some(Missing::new(
                direction.standardised(scores[k]),
                direction.amplitude_sd_m(),
            ))
        };
        [0, 1, 2].map(missing)
    };
    let all: Vec<[Option<Missing>; 3]> = bulges.par_iter().map(of_bulge).collect();
    let each = || all.iter().flatten().flatten();
    // Relative to the largest, so that no exponential overflows.
    let largest = each().map(|m| m.log_factor).fold(0.0, f64::max);
    let weight = |m: &Missing| (m.log_factor - largest).exp();
    let none = each().count() as f64 * (-largest).exp();
    let total = none + each().map(weight).sum::<f64>();
    let mut covariances = vec![Matrix3::zeros(); body.stones.len()];
    for (bulge, directions) in bulges.iter().zip(&all) {
        let square = |k: usize| {
            let missing = directions[k].as_ref();
            missing.map_or(0.0, |m| weight(m) / total * m.square)
        };
        let squares = Vector3::new(square(0), square(1), square(2));
        add_squares(&mut covariances, body, &bulge.stones, &squares);
    }
    covariances
}
