//! The roughness of single stones.

use super::layout::Layout;
use super::local_motion::LocalMotion;
use super::local_pair::LocalPair;
use super::noise_estimate::{deviance, reweighted};
use super::patches::{PatchPoints, pool_into_patches};
use super::surface_noise::{NoiseFactors, SurfaceNoise};
use crate::registration::adjustment::stone_vector::StoneVector;

/// Standard deviation of the logarithm of a stone's roughness over that of most stones: between smooth plaster and
/// rubble lie a factor of a hundred, four standard deviations.
const ROUGHNESS_SD: f64 = 1.2;
/// Most patches that are compared, evenly chosen: each shows a factor of two in roughness.
const PATCHES: usize = 4;
/// Step and range of the roughness.
const STEP: f64 = 2.0;
const ROUGHEST: f64 = 100.0;

/// The roughness of a stone over that of most under which its points are most likely at `motion`, found in steps of two
/// from the present one, on whose surface the points get their weights.
///
/// `inflation`: factor on the points' variances, by which a log likelihood means less.
pub(crate) fn likely_roughness(
    pair: &LocalPair,
    motion: &StoneVector,
    inflation: f64,
    noise: &SurfaceNoise,
    layout: &Layout,
) -> f64 {
    let present = pair.noise.roughness;
    let noise = noise.of_stone(&NoiseFactors {
        roughness: 1.0,
        ..pair.noise
    });
    let motion = LocalMotion::new(motion);
    let all = pool_into_patches(pair, &motion, &motion, &noise, layout).list;
    let stride = all.len().div_ceil(PATCHES).max(1);
    let some: Vec<PatchPoints> = all.into_iter().step_by(stride).collect();
    let patches = reweighted(&some, &noise, layout);
    let value = |roughness: f64| {
        let prior = (roughness.ln() / ROUGHNESS_SD).powi(2);
        deviance(&patches, &noise.on_surface(roughness / present)) / inflation + prior
    };
    let start = (present, value(present));
    let descend = |factor: f64| {
        let mut best = start;
        loop {
            let next = factor * best.0;
            if !(ROUGHEST.recip()..=ROUGHEST).contains(&next) {
                return best;
            }
            match value(next) {
                found if found < best.1 => best = (next, found),
                _ => return best,
            }
        }
    };
    let smoother = descend(STEP.recip());
    match smoother.1 < start.1 {
        true => smoother.0,
        false => descend(STEP).0,
    }
}
