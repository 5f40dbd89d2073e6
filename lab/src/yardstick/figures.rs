//! What is counted of a survey.

use super::measure::{Claim, Found, Measured};
use super::wall::Truth;
use crate::figures::{chi_square, median, rms, share};
use statrs::distribution::{ContinuousCDF, Normal};
use std::collections::BTreeMap;

/// Figures by their names; those that mean nothing for a survey are left out. Lengths in millimetres, shares 0..1.
pub type Figures = BTreeMap<String, f64>;

/// Levels of the intervals, and how figures name them.
pub const LEVELS: [(f64, &str); 4] = [(0.5, "50"), (0.8, "80"), (0.95, "95"), (0.99, "99")];
/// A stone is an island where it is wrong by more than both: standard deviations, and millimetres.
const ISLAND: [f64; 2] = [5.0, 5.0];

/// When a figure is better.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Better {
    Less,
    More,
    /// Near this value.
    Near(f64),
}

/// Figures that are better the less they are, and the more.
const LESS: &str = "in_rmse in_median out_rmse out_median absolute_rmse deformation_rmse velocity_rmse free_score \
                    absolute_score relative_score deformation_score velocity_score pit islands false_verdict \
                    missed_verdict areas_missed areas_false seconds memory_mb";
const MORE: &str = "measured loose_precision loose_recall refused_odd areas_found areas_held creep_named steps_named \
                    datum_known";

/// A stone: the truth of it, and what was found.
type Stone = (Truth, Option<Found>);

/// All figures by their names.
pub fn columns() -> Vec<(String, Better)> {
    let column = |better| move |name: &str| (name.to_owned(), better);
    let mut all: Vec<_> = LESS.split(' ').map(column(Better::Less)).collect();
    all.extend(MORE.split(' ').map(column(Better::More)));
    all.push(("chi_square".to_owned(), Better::Near(1.0)));
    for kind in ["free", "absolute", "relative", "deformation", "velocity"] {
        all.extend(LEVELS.map(|(level, text)| (format!("{kind}_{text}"), Better::Near(level))));
    }
    all
}

/// The figures of a survey; time and memory apart.
pub fn figures(measured: &Measured) -> Figures {
    let countable = || measured.stones.iter().filter(|(t, _)| t.is_countable);
    let found: Vec<&Found> = countable().filter_map(|(_, f)| f.as_ref()).collect();
    let count = |of: &dyn Fn(&Stone) -> bool| countable().filter(|s| of(s)).count() as f64;
    let is_called = |f: &Option<Found>| f.as_ref().is_some_and(|f| f.is_called_loose);
    let all =
        |of: &dyn Fn(&Found) -> Option<Claim>| -> Vec<Claim> { found.iter().filter_map(|f| of(f)).collect() };
    let free = all(&|f| Some(f.free));
    let kinds = [
        ("free", free.clone()),
        ("absolute", all(&|f| f.absolute)),
        ("relative", all(&|f| Some(f.relative))),
        ("deformation", all(&|f| f.deformation)),
    ];

    let mut figures = Figures::new();
    // No number where there is nothing to count.
    let mut put = |name: &str, value: f64| {
        if value.is_finite() {
            figures.insert(name.to_owned(), value);
        }
    };
    put("measured", found.len() as f64 / count(&|_| true));
    let plane = || free.iter().map(|(e, _)| 1e3 * e.xy().norm());
    let out = || free.iter().map(|(e, _)| 1e3 * e.z.abs());
    if !free.is_empty() {
        put("in_rmse", rms(plane()));
        put("out_rmse", rms(out()));
    }
    put("in_median", median(plane()));
    put("out_median", median(out()));
    for (name, claims) in &kinds {
        let axes = axes(claims);
        if axes.is_empty() {
            continue;
        }
        for (level, text) in LEVELS {
            put(&format!("{name}_{text}"), coverage(&axes, level));
        }
        let score = axes
            .iter()
            .map(|[e, sd]| interval_score(*e, *sd, 0.95))
            .sum::<f64>();
        put(&format!("{name}_score"), 1e3 * score / axes.len() as f64);
        if ["absolute", "deformation"].contains(name) {
            put(
                &format!("{name}_rmse"),
                1e3 * rms(claims.iter().map(|(e, _)| e.norm())),
            );
        }
    }
    put("pit", pit_distance(&axes(&free)));
    let squares: Vec<f64> = free.iter().map(|(e, c)| chi_square(e, c) / 3.0).collect();
    put("chi_square", squares.iter().sum::<f64>() / squares.len() as f64);

    let right = count(&|(t, f)| t.is_loose && is_called(f));
    put("loose_precision", right / count(&|(_, f)| is_called(f)));
    put("loose_recall", right / count(&|(t, _)| t.is_loose));
    let everything = || measured.stones.iter().filter_map(|(_, f)| f.as_ref());
    put("islands", everything().filter(|f| is_island(f)).count() as f64);
    let odd: Vec<&Option<Found>> = measured
        .stones
        .iter()
        .filter(|(t, _)| t.is_odd)
        .map(|(_, f)| f)
        .collect();
    put("refused_odd", share(odd.len(), |k| odd[k].is_none()));

    let is_called =
        |(_, f): &(Truth, Option<Found>)| f.as_ref().is_some_and(|f| f.is_called_loose || f.is_called_moved);
    let is_shown = measured.is_deformed || measured.stones.iter().any(is_called);
    let is_false = measured.false_areas.is_some_and(|n| n > 0)
        || measured.stones.iter().any(|s| s.0.is_still() && is_called(s));
    match measured.is_still {
        true => put("false_verdict", f64::from(u8::from(is_false))),
        false => put("missed_verdict", f64::from(u8::from(!is_shown))),
    }
    if !measured.areas.is_empty() {
        let found = measured.areas.iter().filter(|found| **found).count();
        put("areas_found", found as f64);
        put("areas_missed", (measured.areas.len() - found) as f64);
    }
    put("areas_held", share(measured.held.len(), |k| measured.held[k]));
    put("areas_false", measured.false_areas.map_or(f64::NAN, |n| n as f64));
    put(
        "datum_known",
        f64::from(u8::from(found.iter().any(|f| f.absolute.is_some()))),
    );
    figures
}

/// Grossly wrong, and sure of it.
fn is_island(found: &Found) -> bool {
    let (error, covariance) = found.absolute.as_ref().unwrap_or(&found.free);
    chi_square(error, covariance) > ISLAND[0].powi(2) && 1e3 * error.norm() > ISLAND[1]
}

/// Errors with their standard deviations, each axis by itself.
fn axes(claims: &[Claim]) -> Vec<[f64; 2]> {
    let of = |(e, c): &Claim| [0, 1, 2].map(|a| [e[a], c[(a, a)].max(0.0).sqrt()]);
    claims.iter().flat_map(of).collect()
}

/// Half-width of a central interval, standard deviations.
fn half_width(level: f64) -> f64 {
    Normal::standard().inverse_cdf(0.5 + 0.5 * level)
}

/// Share of the errors inside their interval.
pub fn coverage(axes: &[[f64; 2]], level: f64) -> f64 {
    let half = half_width(level);
    share(axes.len(), |k| axes[k][0].abs() <= half * axes[k][1])
}

/// Score of a central interval about zero: its width, and a fine where the error lies beyond it (Gneiting and Raftery
/// 2007, eq. 43). The lower, the better.
pub fn interval_score(error: f64, sd: f64, level: f64) -> f64 {
    let half = half_width(level) * sd;
    2.0 * half + 2.0 / (1.0 - level) * (error.abs() - half).max(0.0)
}

/// Largest distance of the distribution of the errors' probability integral transforms from the uniform one (that of
/// Kolmogorov); NaN without errors. Stones share errors, so that no level belongs to it.
fn pit_distance(axes: &[[f64; 2]]) -> f64 {
    let of = |[error, sd]: &[f64; 2]| Normal::standard().cdf(error / sd.max(f64::MIN_POSITIVE));
    let mut transformed: Vec<f64> = axes.iter().map(of).collect();
    transformed.sort_by(f64::total_cmp);
    let n = transformed.len() as f64;
    let apart = |(k, u): (usize, &f64)| (u - k as f64 / n).abs().max((u - (k + 1) as f64 / n).abs());
    transformed
        .iter()
        .enumerate()
        .map(apart)
        .fold(if axes.is_empty() { f64::NAN } else { 0.0 }, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use stonewise_simulate::normal;

    /// Errors of which `claimed` times their standard deviation is claimed.
    fn drawn(claimed: f64) -> Vec<[f64; 2]> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        (0..200_000)
            .map(|k| {
                let sd = 1e-3 * (1.0 + f64::from(k % 7));
                [sd * normal(&mut rng), claimed * sd]
            })
            .collect()
    }

    #[test]
    fn coverage_of_a_known_normal_distribution() {
        let right = drawn(1.0);
        for (level, _) in LEVELS {
            assert!((coverage(&right, level) - level).abs() < 4e-3, "{level}");
        }
        // Half as wide: P(|z| < 0.98) = erf(0.98 / sqrt 2) = 0.6729.
        assert!((coverage(&drawn(0.5), 0.95) - 0.6729).abs() < 4e-3);
    }

    /// By hand: half-width 1.959964 of sd 1. An error of 1 costs the width 3.919928; one of 3 costs 40 (3 - 1.959964)
    /// more. Of normal errors the mean is 4 / alpha phi(z) sd = 80 times 0.0584451.
    #[test]
    fn interval_score_by_hand() {
        assert!((interval_score(1.0, 1.0, 0.95) - 3.919_928).abs() < 1e-6);
        assert!((interval_score(-3.0, 1.0, 0.95) - 45.521_368).abs() < 1e-5);
        assert!((interval_score(0.0, 2.0, 0.5) - 2.697_959).abs() < 1e-6);
        let mean = |errors: &[[f64; 2]]| {
            errors
                .iter()
                .map(|[e, sd]| interval_score(e / 4e-3, sd / 4e-3, 0.95))
                .sum::<f64>()
                / errors.len() as f64
        };
        assert!((mean(&drawn(1.0)) - 4.675_61).abs() < 0.05);
        assert!(mean(&drawn(0.7)) > mean(&drawn(1.0)) && mean(&drawn(1.4)) > mean(&drawn(1.0)));
    }

    /// The largest distance of Phi(c z) from Phi(z) is 0.1614 at c = 0.5 (z = 1.36, where both densities agree).
    #[test]
    fn pit_is_uniform_where_claims_are_right() {
        assert!(pit_distance(&drawn(1.0)) < 4e-3);
        assert!((pit_distance(&drawn(2.0)) - 0.161_4).abs() < 4e-3);
        assert!((pit_distance(&[[0.0, 1.0]]) - 0.5).abs() < 1e-12);
        assert!(pit_distance(&[]).is_nan());
    }
}
