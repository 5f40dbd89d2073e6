//! The variances under which observations are most likely.

use crate::progress::{Interrupted, Progress};
use rayon::prelude::*;

/// Most steps: eight of at most [`LARGEST_STEP`] cross five decades.
const STEPS: usize = 8;
/// Distance of the values through which a parabola is laid in each logarithm: a factor of 1.5, over which
/// deviances of 100 stones change by more than rounding and are still nearly quadratic.
const WIDTH: f64 = 0.4;
/// Largest change of a logarithm in one step: a factor of 4.5, beyond which a parabola of width [`WIDTH`]
/// says nothing.
const LARGEST_STEP: f64 = 1.5;
/// Curvature below which the deviance counts as flat and a full step downhill is taken.
const FLAT: f64 = 1e-3;
/// Shares of the step that are tried: the variances are correlated, so the full step may overshoot.
const STEP_SHARES: [f64; 4] = [1.0, 0.5, 0.2, 0.05];
/// The search ends when a step gains less deviance than this: a hundredth of a standard error.
const LEAST_GAIN: f64 = 0.02;
/// Deviance of variances for which the equations cannot be factored: worse than all others, and finite so
/// that differences stay so.
const UNSOLVABLE: f64 = f64::MAX / 1e6;

/// Logarithms at which `deviance` is least, within `bounds` of what they are the logarithms of; the first `free` of them
/// are sought.
///
/// A Newton step from parabolas along each, then a search along it. Cost: at most 8 x (2 N + 5) deviances.
///
/// # Errors
/// The caller stopped the work.
pub(super) fn least_deviance<const N: usize>(
    start: [f64; N],
    free: usize,
    bounds: &[[f64; 2]; N],
    deviance: impl Fn(&[f64; N]) -> Option<f64> + Sync,
    progress: &dyn Progress,
) -> Result<[f64; N], Interrupted> {
    let clamp = |log: [f64; N]| -> [f64; N] {
        std::array::from_fn(|k| log[k].clamp(bounds[k][0].ln(), bounds[k][1].ln()))
    };
    let all = |places: &[[f64; N]]| -> Vec<f64> {
        let value = |log: &[f64; N]| deviance(log).unwrap_or(UNSOLVABLE);
        places.par_iter().map(value).collect()
    };
    let mut log = clamp(start);
    for _ in 0..STEPS {
        progress.check()?;
        let mut places = vec![log];
        for k in 0..free {
            for side in [-WIDTH, WIDTH] {
                let mut beside = log;
                beside[k] += side;
                places.push(clamp(beside));
            }
        }
        let values = all(&places);
        let step: [f64; N] = std::array::from_fn(|k| match k < free {
            true => along(values[0], [values[1 + 2 * k], values[2 + 2 * k]]),
            false => 0.0,
        });
        let tried = STEP_SHARES.map(|share| clamp(std::array::from_fn(|k| log[k] + share * step[k])));
        let best = all(&tried)
            .into_iter()
            .zip(tried)
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match best.filter(|(least, _)| *least <= values[0] - LEAST_GAIN) {
            Some((_, best)) => log = best,
            None => break,
        }
    }
    Ok(log)
}

/// The step along one logarithm, from the deviance here and on either side.
fn along(here: f64, [below, above]: [f64; 2]) -> f64 {
    let curvature = below + above - 2.0 * here;
    let slope = 0.5 * (below - above);
    match curvature > FLAT {
        true => (WIDTH * slope / curvature).clamp(-LARGEST_STEP, LARGEST_STEP),
        false => LARGEST_STEP * slope.clamp(-1.0, 1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    /// Minus twice the log likelihood of variances of which these are the most likely ones, from 50 observations each.
    fn deviance(log: &[f64; 3], likeliest: &[f64; 3]) -> f64 {
        let of_one = |(log, likeliest): (&f64, &f64)| 50.0 * (log + (likeliest - log).exp());
        log.iter().zip(likeliest).map(of_one).sum()
    }

    #[test]
    fn the_likeliest_variances_within_the_bounds_are_found() {
        let likeliest = [1e-4, 3e-7, 2.0].map(f64::ln);
        let bounds = [[1e-8, 1.0], [1e-6, 1.0], [1e-3, 10.0]];
        let found = |free| {
            let start = [1e-2, 1e-2, 0.5].map(f64::ln);
            let value = |log: &[f64; 3]| Some(deviance(log, &likeliest));
            least_deviance(start, free, &bounds, value, &Silent).unwrap()
        };
        let [one, two, three] = found(3);
        assert!((one - likeliest[0]).abs() < 0.05, "{one}");
        assert!((two - 1e-6_f64.ln()).abs() < 1e-12, "{two}");
        assert!((three - likeliest[2]).abs() < 0.05, "{three}");
        assert_eq!(found(2)[2], 0.5_f64.ln());
        let unsolvable = least_deviance([0.0], 1, &[[0.1, 10.0]], |_| None, &Silent);
        assert_eq!(unsolvable, Ok([0.0]));
    }
}
