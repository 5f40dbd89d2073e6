//! Estimation of the variances of the sources' errors, by restricted maximum likelihood from differences
//! within the epochs.

use super::components::{BOUNDS, COUNT, ObserverComponents, SensorClass};
use super::model::{Prior, Problem};
use crate::progress::{Interrupted, Progress};
use rayon::prelude::*;

/// The components under which the differences are most probable.
///
/// # Errors
/// The caller stopped the work.
pub(super) fn estimate(
    problem: &Problem,
    class: SensorClass,
    progress: &dyn Progress,
) -> Result<ObserverComponents, Interrupted> {
    let value = |log: &[f64; COUNT]| {
        let components = ObserverComponents::from_log(*log);
        let deviance = problem.deviance(&Prior::new(&components, 0.0), &components);
        deviance.map_or(f64::MAX / 1e6, |d| d + components.penalty(class))
    };
    let clamp = |log: [f64; COUNT]| -> [f64; COUNT] {
        std::array::from_fn(|k| log[k].clamp(BOUNDS[k][0].ln(), BOUNDS[k][1].ln()))
    };
    let mut log = clamp(ObserverComponents::expected(class).to_log());
    let mut width = 0.5;

    for _ in 0..12 {
        progress.check()?;
        let mut probes = vec![log];
        for k in 0..COUNT {
            for sign in [-1.0, 1.0] {
                let mut l = log;
                l[k] += sign * width;
                probes.push(l);
            }
        }
        let values: Vec<f64> = probes.par_iter().map(value).collect();
        let step: [f64; COUNT] = std::array::from_fn(|k| {
            let (below, above) = (values[1 + 2 * k], values[2 + 2 * k]);
            let curvature = below + above - 2.0 * values[0];
            let slope = 0.5 * (below - above);
            match curvature > 1e-3 {
                true => (width * slope / curvature).clamp(-1.0, 1.0),
                false => slope.clamp(-1.0, 1.0),
            }
        });
        let candidates: Vec<[f64; COUNT]> = [1.0, 0.5, 0.2, 0.05]
            .map(|scale| clamp(std::array::from_fn(|k| log[k] + scale * step[k])))
            .to_vec();
        let trial: Vec<f64> = candidates.par_iter().map(value).collect();
        let best = (0..trial.len())
            .min_by(|&a, &b| trial[a].total_cmp(&trial[b]))
            .unwrap_or(0);
        if trial[best] < values[0] - 0.01 {
            log = candidates[best];
        } else if width < 0.2 {
            break;
        }
        width = (0.7 * width).max(0.1);
    }

    Ok(ObserverComponents::from_log(log))
}
