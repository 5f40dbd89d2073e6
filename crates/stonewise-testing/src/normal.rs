//! Noise.

use rand::RngExt;
use std::f64::consts::TAU;

/// A standard normal number (Box & Muller 1958).
pub fn normal(rng: &mut impl RngExt) -> f64 {
    let (u, v): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * (TAU * v).cos()
}
