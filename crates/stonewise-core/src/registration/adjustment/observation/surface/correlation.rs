//! How much less the points say than independent ones would.
//!
//! Scan lines, matching windows and differing stations make neighbouring points err alike. The means of both
//! epochs over small and over larger cells of a face then differ by more than the noise of single points
//! explains.

use crate::registration::adjustment::observation::surface::equations::Equations;
use crate::statistics::upper_median;
use crate::switches::switchable;

/// Cells that a stone needs to be judged: twice the unknowns that its own points determine at most.
const CELLS: usize = 10;
/// Cells needed for slopes, where cells have different weights and the mean alone is taken off.
const SLOPE_CELLS: f64 = 4.0;
/// Stones that a survey needs to be judged: the median of fewer moves by a third with one stone.
const STONES: usize = 10;
/// Weight, in cells, of the prior that a stone's noise is that of the survey: as many cells as a median stone
/// has.
const PRIOR_CELLS: f64 = 30.0;
/// A cell counts no more than this, in expected squares (seven standard deviations): a single disturbed cell
/// does not condemn a stone.
const CAP: f64 = 50.0;

/// How much larger squared differences of cell means are than for independent noise, in the median of the
/// stones; at least 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Correlation {
    /// In small cells of a face: noise shared by neighbouring points.
    pub small: f64,
    /// In larger cells: also what is shared over decimetres.
    pub large: f64,
    /// In what the small cells' slopes say of motions in the face: points err more at steep rims.
    pub slopes: f64,
}

impl Correlation {
    /// The factors of independent noise.
    pub const NONE: Self = Self {
        small: 1.0,
        large: 1.0,
        slopes: 1.0,
    };

    /// `fitted`: how many unknowns each stone's own points determined, which their cells lack.
    pub fn of(stones: &[(&Equations, f64)]) -> Self {
        let middle = |of: &dyn Fn(&Equations, f64) -> Option<f64>| {
            let mut ratios: Vec<f64> = stones.iter().filter_map(|(e, fitted)| of(e, *fitted)).collect();
            let middle = upper_median(&mut ratios).filter(|_| ratios.len() >= STONES);
            middle.unwrap_or(1.0).max(1.0)
        };
        Self {
            small: middle(&|e, fitted| excess(&e.differences, fitted)),
            large: middle(&|e, fitted| excess(&e.coarse_differences, fitted)),
            slopes: middle(&|e, _| slope_excess(e)),
        }
    }

    /// Factor on all variances of the survey.
    pub fn factor(&self) -> f64 {
        self.small.max(self.large)
    }
}

/// Further factor on one stone's variances, at least 1.
///
/// Only small cells are compared, with those of most stones: the survey's factor may be that of the larger ones.
pub(crate) fn stone_factor(stone: &Equations, fitted: f64, survey: &Correlation) -> f64 {
    switchable!("stone_factor", 1.0);
    let cells = stone.differences.len() as f64;
    let ratios = stone.differences.iter().map(|d| (d / survey.small).min(CAP));
    let sum: f64 = ratios.sum();
    ((PRIOR_CELLS + sum) / (PRIOR_CELLS + (cells - fitted).max(0.0))).max(1.0)
}

/// Factor on the variances of one stone's motion in the face, for the survey's factor on them; at least 1.
pub(crate) fn stone_slope_factor(stone: &Equations, survey: f64) -> f64 {
    switchable!("slopes", 1.0);
    let freedom = slope_freedom(stone);
    let ratio = slope_ratio(stone).min(CAP * survey);
    ((PRIOR_CELLS * survey + freedom * ratio) / (PRIOR_CELLS + freedom)).max(1.0)
}

/// Variance, m^2, of an error that all points of a stone share, in any direction, per octave of length.
///
/// Correlation of neighbouring points alone raises small and larger cells by the same factor; what larger
/// cells have beyond that does not fade with their size. It is taken to have as much power in every octave of
/// length, as errors of stereo matching and drifting scan lines do, and so to be there at the size of a stone
/// too, and at that of the wall.
pub(crate) fn shared_variance(stones: &[&Equations], correlation: &Correlation) -> f64 {
    switchable!("shared", 0.0);
    let mut variances: Vec<f64> = stones
        .iter()
        .flat_map(|e| e.coarse_variances.iter().copied())
        .collect();
    upper_median(&mut variances).unwrap_or(0.0) * (correlation.large - correlation.small).max(0.0)
}

/// How much more a stone's cells scatter in what their slopes say than noise alone explains: the ratio of an
/// empirical to a model variance of the motion (White 1980).
fn slope_ratio(stone: &Equations) -> f64 {
    let [found, expected] = stone
        .slopes
        .map(|s| s.sums())
        .iter()
        .fold([0.0; 2], |a, s| [a[0] + s[0], a[1] + s[1]]);
    if expected > 0.0 { found / expected } else { 1.0 }
}

fn slope_freedom(stone: &Equations) -> f64 {
    stone.slopes.iter().map(|s| s.freedom()).sum()
}

/// [`slope_ratio`], made comparable in the median.
fn slope_excess(stone: &Equations) -> Option<f64> {
    let freedom = slope_freedom(stone);
    (freedom >= SLOPE_CELLS).then(|| slope_ratio(stone) / median_of_law(freedom))
}

/// Median of a chi-square variable over its mean (Wilson & Hilferty 1931).
fn median_of_law(freedom: f64) -> f64 {
    (1.0 - 2.0 / (9.0 * freedom)).powi(3)
}

/// Mean of a stone's cells over that of independent points, made comparable in the median.
fn excess(cells: &[f64], fitted: f64) -> Option<f64> {
    let freedom = (cells.len() as f64 - fitted).max(1.0);
    (cells.len() >= CELLS).then(|| cells.iter().sum::<f64>() / freedom / median_of_law(freedom))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::observation::surface::testing::without_points;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ChiSquared, ContinuousCDF};
    use stonewise_testing::normal;

    /// Stones whose squared differences in small and large cells are `factors` times chi-square with one
    /// degree of freedom.
    fn stones(factors: [f64; 2], seed: u64) -> Vec<Equations> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut squares =
            |count: usize, factor: f64| (0..count).map(|_| factor * normal(&mut rng).powi(2)).collect();
        (0..300)
            .map(|_| Equations {
                differences: squares(40, factors[0]),
                coarse_differences: squares(12, factors[1]),
                coarse_variances: vec![1e-8; 12],
                ..without_points()
            })
            .collect()
    }

    fn correlation_of(stones: &[Equations]) -> Correlation {
        Correlation::of(&stones.iter().map(|e| (e, 0.0)).collect::<Vec<_>>())
    }

    #[test]
    fn simulated_factors_are_found() {
        for factors in [[1.0, 1.0], [2.0, 2.0], [1.5, 4.0]] {
            let found = correlation_of(&stones(factors, 1));
            assert!(
                (found.small / factors[0] - 1.0).abs() < 0.05,
                "{found:?} {factors:?}"
            );
            assert!(
                (found.large / factors[1] - 1.0).abs() < 0.08,
                "{found:?} {factors:?}"
            );
            assert_eq!(found.slopes, 1.0);
        }
        assert_eq!(correlation_of(&stones([3.0, 3.0], 2)[..9]), Correlation::NONE);
    }

    #[test]
    fn only_what_large_cells_have_beyond_small_ones_is_shared() {
        let shared = |factors: [f64; 2]| {
            let stones = stones(factors, 3);
            shared_variance(&stones.iter().collect::<Vec<_>>(), &correlation_of(&stones))
        };
        assert!(shared([2.0, 2.0]) < 3e-9);
        let found = shared([1.0, 5.0]);
        assert!((found / 4e-8 - 1.0).abs() < 0.1, "{found}");
    }

    #[test]
    fn a_noisy_stone_gets_a_factor_of_its_own_and_a_quiet_one_none() {
        let noisy = &stones([6.0, 1.0], 4)[0];
        let quiet = &stones([0.5, 1.0], 5)[0];
        let sum: f64 = noisy.differences.iter().map(|d| d / 2.0).sum();
        // By how much larger cells differ, and with it the survey's factor, does not matter.
        for large in [1.0, 2.0, 6.0] {
            let survey = Correlation {
                small: 2.0,
                large,
                slopes: 1.0,
            };
            let factor = stone_factor(noisy, 0.0, &survey);
            let expected = (PRIOR_CELLS + sum) / (PRIOR_CELLS + 40.0);
            assert!((factor - expected).abs() < 1e-12, "{factor} {expected}");
            assert!(factor > 1.5);
            assert_eq!(stone_factor(quiet, 0.0, &survey), 1.0);
            assert_eq!(stone_factor(&without_points(), 0.0, &survey), 1.0);
        }
    }

    #[test]
    fn slopes_that_scatter_more_than_their_noise_are_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let stones: Vec<Equations> = (0..200)
            .map(|_| {
                let mut stone = without_points();
                for scatter in &mut stone.slopes {
                    for _ in 0..25 {
                        let weight: f64 = rng.random_range(1e5..1e7);
                        scatter.add(0.01 + normal(&mut rng) * (1.8 / weight).sqrt(), weight);
                    }
                }
                stone
            })
            .collect();
        let found = correlation_of(&stones);
        assert!((found.slopes / 1.8 - 1.0).abs() < 0.06, "{found:?}");
        let factors: f64 = stones.iter().map(|s| stone_slope_factor(s, found.slopes)).sum();
        assert!((factors / 200.0 / 1.8 - 1.0).abs() < 0.08, "{factors}");
    }

    #[test]
    fn the_median_of_a_chi_square_variable_is_that_of_the_law() {
        for freedom in [4.0, 12.0, 40.0] {
            let law = ChiSquared::new(freedom).unwrap();
            let expected = law.inverse_cdf(0.5) / freedom;
            assert!((median_of_law(freedom) / expected - 1.0).abs() < 0.005);
        }
    }
}
