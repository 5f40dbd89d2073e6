//! Noise of the points and roughness of the stones, by restricted maximum likelihood (REML).

use super::layout::Layout;
use super::local_motion::LocalMotion;
use super::local_pair::LocalPair;
use super::patch_fit::PatchFit;
use super::patches::{PatchChoice, PatchPoints, pool_into_patches};
use super::robust::robust_fit;
use super::surface_noise::SurfaceNoise;
use crate::registration::adjustment::stone_vector::StoneVector;
use crate::statistics::upper_median;
use crate::switches::switchable;
use rayon::prelude::*;

/// Patches that the estimate uses at most; more do not move it by a percent.
const PATCHES: usize = 64;
/// Scatter of a patch's points, in units of the usual one, beyond which they are not those of the wall alone: ivy or a
/// net in one of the epochs. Incidence and range change the noise of a scanner by a factor of two.
const FOREIGN: f64 = 4.0;
/// Most steps; six are usual from a start that is off by a factor of three.
const STEPS: usize = 12;
/// Largest change of a logarithm in one step: a factor of 3.3, as far as the first parabola's width can be
/// trusted.
const LARGEST_STEP: f64 = 1.2;
/// Distance in a logarithm, first and least, of the values through which a parabola is laid; it shrinks with
/// the steps.
const WIDTHS: [f64; 2] = [0.5, 0.1];
/// Curvature below which the deviance counts as flat and the largest step downhill is taken.
const FLAT: f64 = 1e-9;
/// Times that a step is halved where it goes uphill.
const HALVINGS: usize = 4;
/// The estimate is done when no logarithm changes by more: a percent, less than its own uncertainty.
const SETTLED: f64 = 0.01;
/// Range of standard deviations, metres: below a micrometre and above half a metre nothing is a survey.
const RANGE_M: [f64; 2] = [1e-6, 0.5];
/// Deviance of a patch that cannot be factored: worse than all others, and finite so that differences stay
/// so.
const UNSOLVABLE: f64 = f64::MAX / 1e6;

/// The noise under which the sampled stones' points are most likely, surface and planes integrated out.
///
/// Patches that something else covers in one of the epochs are left out, as long as they are fewer than half.
///
/// Source: Patterson & Thompson 1971 (restricted likelihood); a quadratic through three values in each
/// logarithm, until no step exceeds a percent.
pub(crate) fn estimate_noise(
    sample: &[(&LocalPair, StoneVector)],
    start: &SurfaceNoise,
    layout: &Layout,
) -> SurfaceNoise {
    let patches = without_foreign(sampled(sample, start, layout), start, layout);
    if patches.is_empty() {
        return *start;
    }
    let mut log = [start.sigma_m[0].ln(), start.sigma_m[1].ln(), start.tau_m.ln()];
    let [mut width, least_width] = WIDTHS;
    for _ in 0..STEPS {
        let weighted = reweighted(&patches, &from_log(log), layout);
        let value = |log: [f64; 3]| deviance_of_weighted(&weighted, &from_log(log));
        let next = downhill(log, width, value);
        let change = (0..3).map(|k| (next[k] - log[k]).abs()).fold(0.0, f64::max);
        log = next;
        width = (0.5 * width).max(change.min(WIDTHS[0])).max(least_width);
        if change < SETTLED {
            break;
        }
    }
    from_log(log)
}

/// A step towards the minima of parabolas along each logarithm. The three are nearly independent; where they
/// are not, a shorter step still goes down.
fn downhill(log: [f64; 3], width: f64, value: impl Fn([f64; 3]) -> f64) -> [f64; 3] {
    let here = value(log);
    let step = [0, 1, 2].map(|k| {
        let at = |d: f64| {
            let mut l = log;
            l[k] += d;
            value(l)
        };
        let (below, above) = (at(-width), at(width));
        let curvature = below + above - 2.0 * here;
        if curvature > FLAT {
            (0.5 * width * (below - above) / curvature).clamp(-LARGEST_STEP, LARGEST_STEP)
        } else {
            LARGEST_STEP * (below - above).signum()
        }
    });
    let [least, most] = RANGE_M.map(f64::ln);
    let mut scale = 1.0;
    let mut next = log;
    for _ in 0..HALVINGS {
        next = [0, 1, 2].map(|k| (log[k] + scale * step[k]).clamp(least, most));
        if value(next) <= here {
            break;
        }
        scale *= 0.5;
    }
    next
}

fn from_log(log: [f64; 3]) -> SurfaceNoise {
    SurfaceNoise {
        sigma_m: [log[0].exp(), log[1].exp()],
        tau_m: log[2].exp(),
    }
}

/// Evenly chosen patches of the sampled stones, at their present motion.
fn sampled(sample: &[(&LocalPair, StoneVector)], noise: &SurfaceNoise, layout: &Layout) -> Vec<PatchPoints> {
    let all: Vec<PatchPoints> = sample
        .par_iter()
        .map(|(pair, x)| {
            let motion = LocalMotion::new(x);
            pool_into_patches(pair, &motion, &motion, noise, layout, PatchChoice::All).list
        })
        .collect::<Vec<_>>()
        .into_iter()
        .flatten()
        .collect();
    let stride = all.len().div_ceil(PATCHES).max(1);
    all.into_iter().step_by(stride).collect()
}

/// The patches whose points scatter about the surface of both epochs like those of the others.
fn without_foreign(patches: Vec<PatchPoints>, noise: &SurfaceNoise, layout: &Layout) -> Vec<PatchPoints> {
    switchable!("foreign", patches);
    let scatters: Vec<[f64; 2]> = patches.par_iter().map(|p| scatter(p, noise, layout)).collect();
    let limits = [0, 1].map(|epoch| {
        let mut all: Vec<f64> = scatters.iter().map(|s| s[epoch]).collect();
        upper_median(&mut all).map_or(f64::INFINITY, |usual| FOREIGN * usual)
    });
    let is_alike = |scatter: &[f64; 2]| (0..2).all(|epoch| scatter[epoch] <= limits[epoch]);
    let pairs = patches.into_iter().zip(&scatters);
    pairs
        .filter(|(_, s)| is_alike(s))
        .map(|(patch, _)| patch)
        .collect()
}

/// Median distance of a patch's points of each epoch from the surface of both, metres; zero where they determine none.
fn scatter(patch: &PatchPoints, noise: &SurfaceNoise, layout: &Layout) -> [f64; 2] {
    let mut epochs = patch.epochs.clone();
    let Some(fit) = robust_fit(patch.grid, &mut epochs, noise, layout) else {
        return [0.0; 2];
    };
    epochs.map(|points| {
        let mut distances: Vec<f64> = fit.residuals(&points).into_iter().map(f64::abs).collect();
        upper_median(&mut distances).unwrap_or(0.0)
    })
}

/// Copies of the patches, their points weighted by a robust fit of the surface; without patches that cannot be fitted.
fn reweighted(patches: &[PatchPoints], noise: &SurfaceNoise, layout: &Layout) -> Vec<PatchPoints> {
    patches
        .par_iter()
        .filter_map(|p| {
            let mut epochs = p.epochs.clone();
            robust_fit(p.grid, &mut epochs, noise, layout)?;
            Some(PatchPoints { epochs, ..*p })
        })
        .collect()
}

/// Minus twice the log marginal likelihood of the points with these weights, up to a constant.
fn deviance_of_weighted(patches: &[PatchPoints], noise: &SurfaceNoise) -> f64 {
    let terms: Vec<f64> = patches
        .par_iter()
        .map(|p| {
            let fit = PatchFit::of(p.grid, p.observed(noise), noise);
            fit.map_or(UNSOLVABLE, |fit| fit.deviance(p.points(), noise))
        })
        .collect();
    terms.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const LAYOUT: Layout = Layout {
        cell_m: 0.016,
        patch_cells: 24,
        outlier_sigmas: 3.5,
    };

    /// A bumpy face of 20 x 16 cm, scanned at random places with white noise.
    fn scan(rng: &mut ChaCha8Rng, sigma_m: f64) -> Vec<[f64; 3]> {
        (0..700)
            .map(|_| {
                let (u, v): (f64, f64) = (rng.random_range(-0.1..0.1), rng.random_range(-0.08..0.08));
                let noise = stonewise_testing::normal(rng);
                [
                    u,
                    v,
                    0.004 * (30.0 * u).sin() + 0.003 * (40.0 * v).cos() + sigma_m * noise,
                ]
            })
            .collect()
    }

    #[test]
    fn simulated_noise_is_found_from_any_start() {
        let truth = [0.002, 0.005];
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let pairs: Vec<LocalPair> = (0..12)
            .map(|_| LocalPair::of_points(scan(&mut rng, truth[0]), scan(&mut rng, truth[1])))
            .collect();
        let sample: Vec<(&LocalPair, StoneVector)> =
            pairs.iter().map(|p| (p, StoneVector::zeros())).collect();
        let found = [1e-4, 3e-2].map(|start| {
            let start = SurfaceNoise {
                sigma_m: [start; 2],
                tau_m: 1e-3,
            };
            estimate_noise(&sample, &start, &LAYOUT)
        });
        for noise in &found {
            for (sigma, truth) in noise.sigma_m.iter().zip(truth) {
                // Trimming outliers beyond 3.5 sigmas costs a percent.
                assert!((sigma / truth - 1.0).abs() < 0.06, "{sigma} {truth}");
            }
        }
        assert!((found[0].tau_m / found[1].tau_m - 1.0).abs() < 0.05, "{found:?}");
    }

    #[test]
    fn ivy_on_a_third_of_the_stones_is_no_noise_of_the_sensor() {
        let truth = [0.002, 0.003];
        let ivy = 0.03;
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let pairs: Vec<LocalPair> = (0..18)
            .map(|stone| {
                let second = if stone % 3 == 0 { ivy } else { truth[1] };
                LocalPair::of_points(scan(&mut rng, truth[0]), scan(&mut rng, second))
            })
            .collect();
        let sample: Vec<(&LocalPair, StoneVector)> =
            pairs.iter().map(|p| (p, StoneVector::zeros())).collect();
        for start in [1e-3, 1e-2] {
            let start = SurfaceNoise {
                sigma_m: [start; 2],
                tau_m: 1e-3,
            };
            let found = estimate_noise(&sample, &start, &LAYOUT);
            for (sigma, truth) in found.sigma_m.iter().zip(truth) {
                assert!((sigma / truth - 1.0).abs() < 0.06, "{sigma} {truth}");
            }
        }
    }

    #[test]
    fn without_points_the_start_stays() {
        let start = SurfaceNoise {
            sigma_m: [0.003; 2],
            tau_m: 0.001,
        };
        assert_eq!(estimate_noise(&[], &start, &LAYOUT), start);
    }
}
