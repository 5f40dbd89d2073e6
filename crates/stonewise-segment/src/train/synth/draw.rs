//! Random numbers in the shapes that the parameters need.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The one source of randomness of a photo.
pub(super) type Rng = ChaCha8Rng;

/// A stream of numbers of a seed, apart from the others: what is drawn from one changes nothing about the
/// rest.
pub(super) fn stream(seed: u64, number: u64) -> Rng {
    let mut rng = Rng::seed_from_u64(seed);
    rng.set_stream(number);
    rng
}

/// Uniform in `low..high`; `low` where the range is empty.
pub(super) fn between(rng: &mut Rng, low: f32, high: f32) -> f32 {
    low + (high - low) * rng.random::<f32>()
}

/// Uniform in the logarithm, both ends positive: as often in 10..20 as in 100..200.
pub(super) fn log_between(rng: &mut Rng, low: f32, high: f32) -> f32 {
    between(rng, low.ln(), high.ln()).exp()
}

/// True with probability `p`.
pub(super) fn chance(rng: &mut Rng, p: f32) -> bool {
    rng.random::<f32>() < p
}

/// A value of `low..high` with probability `p`, else 0: an effect that is often absent.
pub(super) fn sometimes(rng: &mut Rng, p: f32, low: f32, high: f32) -> f32 {
    let value = between(rng, low, high);
    if chance(rng, p) { value } else { 0.0 }
}

/// A standard normal number (Box and Muller 1958).
pub(super) fn normal(rng: &mut Rng) -> f32 {
    let (u, v): (f32, f32) = (rng.random(), rng.random());
    (-2.0 * (1.0 - u).max(1e-7).ln()).sqrt() * (std::f32::consts::TAU * v).cos()
}

/// Smooth step from 0 at `low` to 1 at `high`.
pub(super) fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// `a` at 0, `b` at 1.
pub(super) fn mix(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    [0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * t)
}

/// A colour times a number.
pub(super) fn scaled(colour: [f32; 3], factor: f32) -> [f32; 3] {
    colour.map(|c| c * factor)
}
