//! Noise of the points and roughness of the stones, by restricted maximum likelihood.

use super::equations::{Layout, LocalPair, Motion9, Moved, PatchPoints, cut, robust_fit};
use super::patch::{PatchFit, SurfaceNoise};
use rayon::prelude::*;

/// Patches that the estimate uses at most; more do not move it by a percent.
const PATCHES: usize = 64;
/// Largest change of a logarithm in one step.
const MAX_STEP: f64 = 1.2;

/// The noise under which the sampled stones' points are most likely, surface and planes integrated out.
///
/// Source: Patterson & Thompson 1971 (restricted likelihood); a quadratic through three values in each
/// logarithm, until no step exceeds a percent.
pub(super) fn estimate_noise(
    sample: &[(&LocalPair, Motion9)],
    start: &SurfaceNoise,
    layout: &Layout,
) -> SurfaceNoise {
    let patches = sampled(sample, layout);
    if patches.is_empty() {
        return *start;
    }
    let mut log = [start.sigma_m[0].ln(), start.sigma_m[1].ln(), start.tau_m.ln()];
    let mut width = 0.5;
    for _ in 0..12 {
        let weighted = reweighted(&patches, &from_log(log), layout);
        let value = |log: [f64; 3]| deviance(&weighted, &from_log(log));
        let here = value(log);
        let mut step = [0.0; 3];
        for k in 0..3 {
            let at = |d: f64| {
                let mut l = log;
                l[k] += d;
                value(l)
            };
            let (below, above) = (at(-width), at(width));
            let curvature = below + above - 2.0 * here;
            step[k] = if curvature > 1e-9 {
                (0.5 * width * (below - above) / curvature).clamp(-MAX_STEP, MAX_STEP)
            } else {
                MAX_STEP * (below - above).signum()
            };
        }
        // The three are nearly independent; where they are not, a shorter step still goes down.
        let mut scale = 1.0;
        let mut next = log;
        for _ in 0..4 {
            next = [0, 1, 2].map(|k| (log[k] + scale * step[k]).clamp((1e-6f64).ln(), (0.5f64).ln()));
            if value(next) <= here {
                break;
            }
            scale *= 0.5;
        }
        let change = (0..3).map(|k| (next[k] - log[k]).abs()).fold(0.0, f64::max);
        log = next;
        width = (0.5 * width).max(change.min(0.5)).max(0.1);
        if change < 0.01 {
            break;
        }
    }
    from_log(log)
}

fn from_log(log: [f64; 3]) -> SurfaceNoise {
    SurfaceNoise {
        sigma_m: [log[0].exp(), log[1].exp()],
        tau_m: log[2].exp(),
    }
}

/// Evenly chosen patches of the sampled stones, at their present motion.
fn sampled(sample: &[(&LocalPair, Motion9)], layout: &Layout) -> Vec<PatchPoints> {
    let all: Vec<PatchPoints> = sample
        .par_iter()
        .map(|(pair, x)| {
            let motion = Moved::new(x);
            cut(pair, &motion, &motion, layout).list
        })
        .collect::<Vec<_>>()
        .into_iter()
        .flatten()
        .collect();
    let stride = all.len().div_ceil(PATCHES).max(1);
    all.into_iter().step_by(stride).collect()
}

fn reweighted(patches: &[PatchPoints], noise: &SurfaceNoise, layout: &Layout) -> Vec<PatchPoints> {
    patches
        .par_iter()
        .map(|p| {
            let mut epochs = p.epochs.clone();
            robust_fit(p.grid, &mut epochs, noise, layout);
            PatchPoints { grid: p.grid, epochs }
        })
        .collect()
}

fn deviance(patches: &[PatchPoints], noise: &SurfaceNoise) -> f64 {
    let terms: Vec<f64> = patches
        .par_iter()
        .map(|p| {
            let epochs = [p.epochs[0].as_slice(), p.epochs[1].as_slice()];
            PatchFit::new(p.grid, epochs, noise).map_or(f64::MAX / 1e6, |fit| fit.deviance(epochs, noise))
        })
        .collect();
    terms.iter().sum()
}
