//! The roughness of single stones.

use super::layout::Layout;
use super::local_motion::LocalMotion;
use super::local_pair::LocalPair;
use super::noise_estimate::{deviance_of_observed, reweighted};
use super::patch_grid::Observed;
use super::patches::{PatchChoice, pool_into_patches};
use super::surface_noise::{NoiseFactors, SurfaceNoise};
use crate::registration::adjustment::stone_vector::StoneVector;

/// Standard deviation of the logarithm of a stone's roughness over that of most stones: between smooth plaster and
/// rubble lies a factor of a hundred, four standard deviations.
const ROUGHNESS_SD: f64 = 1.2;
/// Largest number of patches used; one alone tells a factor of two in roughness.
const PATCHES: usize = 4;
/// Step and range of the roughness.
const STEP: f64 = 2.0;
const ROUGHEST: f64 = 100.0;

/// Most likely roughness of a stone at `motion`, as a factor on the usual one; searched in factors of two from the
/// present value, with the points' weights fixed at that value.
///
/// `inflation`: factor on the points' variances; log likelihoods are divided by it.
pub(crate) fn likely_roughness(
    pair: &LocalPair,
    motion: &StoneVector,
    inflation: f64,
    noise: &SurfaceNoise,
    layout: &Layout,
) -> f64 {
    let present = pair.noise.roughness;
    // The patches carry the present roughness, so the noise leaves it out.
    let noise = noise.of_stone(&NoiseFactors {
        roughness: 1.0,
        ..pair.noise
    });
    let motion = LocalMotion::new(motion);
    let pooled = pool_into_patches(
        pair,
        &motion,
        &motion,
        &noise,
        layout,
        PatchChoice::AtMost(PATCHES),
    );
    let patches = reweighted(&pooled.list, &noise, layout);
    // They do not depend on the roughness.
    let observed: Vec<Observed> = patches.iter().map(|p| p.observed(&noise)).collect();
    let value = |roughness: f64| {
        let prior = (roughness.ln() / ROUGHNESS_SD).powi(2);
        let noise = noise.on_surface(roughness / present);
        let terms = patches.iter().zip(&observed);
        let deviance: f64 = terms
            .map(|(patch, observed)| deviance_of_observed(patch, observed.clone(), &noise))
            .sum();
        deviance / inflation + prior
    };
    let start = (present, value(present));
    let search = |factor: f64| {
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
    let smoother = search(STEP.recip());
    match smoother.1 < start.1 {
        true => smoother.0,
        false => search(STEP).0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const NOISE: SurfaceNoise = SurfaceNoise {
        sigma_m: [0.001; 2],
        tau_m: 0.001,
    };
    const LAYOUT: Layout = Layout {
        cell_m: 0.016,
        patch_cells: 24,
        outlier_sigmas: 3.5,
    };

    /// A stone with waves of 15 cm of this height at each place along it, scanned twice.
    fn scanned(half_m: [f64; 2], points: usize, wave_m: impl Fn(f64) -> f64) -> LocalPair {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut scan = || {
            let point = |_| {
                let [u, v] = half_m.map(|half| rng.random_range(-half..half));
                let noise = 0.001 * stonewise_testing::normal(&mut rng);
                [u, v, wave_m(u) * ((40.0 * u).sin() + (42.0 * v).cos()) + noise]
            };
            (0..points).map(point).collect::<Vec<[f64; 3]>>()
        };
        LocalPair::of_points(scan(), scan())
    }

    fn roughness(pair: &LocalPair, layout: &Layout) -> f64 {
        likely_roughness(pair, &StoneVector::zeros(), 1.0, &NOISE, layout)
    }

    #[test]
    fn the_roughness_of_waves_is_found_from_any_start() {
        for wave_m in [0.0, 0.002, 0.016] {
            for start in [0.125, 1.0, 8.0] {
                let mut pair = scanned([0.1, 0.08], 900, |_| wave_m);
                pair.noise.roughness = start;
                let found = roughness(&pair, &LAYOUT);
                // Second differences of a wave of k rad/m have an rms of (2 - 2 cos(k cell)) / sqrt(2) of its height;
                // those along both axes add.
                let expected = 0.42 * wave_m / NOISE.tau_m;
                let is_right = match wave_m > 0.0 {
                    true => (0.4..2.5).contains(&(found / expected)),
                    false => found <= 0.125,
                };
                assert!(is_right, "{wave_m} {start}: {found}, not {expected}");
            }
        }
    }

    #[test]
    fn patches_of_all_columns_take_part() {
        let layout = Layout {
            patch_cells: 8,
            ..LAYOUT
        };
        // Three by three patches, those of one outer column smooth.
        for side in [-1.0, 1.0] {
            let wave_m = |u: f64| if side * u > 0.065 { 0.0 } else { 0.016 };
            let pair = scanned([0.155; 2], 3000, wave_m);
            let found = roughness(&pair, &layout);
            assert!(found >= 2.0, "{side}: {found}");
        }
    }
}
