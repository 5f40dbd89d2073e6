//! How much less the points say than independent ones would.
//!
//! Scan lines, matching windows and differing stations make neighbouring points err alike. The means of both
//! epochs over small and over larger cells of a face then differ by more than the noise of single points explains.

use super::equations::Equations;
use super::survey::median;

/// Cells that a stone needs to be judged.
const CELLS: usize = 10;
/// The same for slopes, where cells have different weights.
const SLOPE_CELLS: f64 = 4.0;
/// Stones that a survey needs to be judged.
const STONES: usize = 10;
/// Cells' worth of belief that a stone's noise is that of the survey.
const PRIOR_CELLS: f64 = 30.0;
/// A cell counts no more than this: a single disturbed cell does not condemn a stone.
const CAP: f64 = 50.0;

/// How much larger squared differences of cell means are than for independent noise, in the median of the stones; at least 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Correlation {
    /// In small cells of a face: noise shared by neighbouring points.
    pub small: f64,
    /// In larger cells: also what is shared over decimetres.
    pub large: f64,
    /// The same of what the small cells' slopes say of motions in the face: points err more at steep rims.
    pub slopes: f64,
}

impl Correlation {
    /// Of independent noise.
    pub const NONE: Self = Self {
        small: 1.0,
        large: 1.0,
        slopes: 1.0,
    };

    /// `fitted`: how many unknowns each stone's own points determined, which their cells lack.
    pub fn of(stones: &[(&Equations, f64)]) -> Self {
        let middle = |of: &dyn Fn(&Equations, f64) -> Option<f64>| {
            let mut ratios: Vec<f64> = stones.iter().filter_map(|(e, fitted)| of(e, *fitted)).collect();
            let middle = median(&mut ratios).filter(|_| ratios.len() >= STONES);
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
pub(super) fn stone_factor(stone: &Equations, fitted: f64, survey: f64) -> f64 {
    let cells = stone.differences.len() as f64;
    let sum: f64 = stone.differences.iter().map(|d| (d / survey).min(CAP)).sum();
    ((PRIOR_CELLS + sum) / (PRIOR_CELLS + (cells - fitted).max(0.0))).max(1.0)
}

/// Factor on the variances of one stone's motion in the face, for the survey's factor on them; at least 1.
pub(super) fn stone_slope_factor(stone: &Equations, survey: f64) -> f64 {
    let freedom = slope_freedom(stone);
    let ratio = slope_ratio(stone).min(CAP * survey);
    ((PRIOR_CELLS * survey + freedom * ratio) / (PRIOR_CELLS + freedom)).max(1.0)
}

/// Variance, m^2, of an error that all points of a stone share, in any direction, per octave of length.
///
/// Correlation of neighbouring points alone raises small and larger cells by the same factor; what larger cells have beyond that does
/// not fade with their size. It is taken to have as much power in every octave of length, as errors of stereo matching and drifting
/// scan lines do, and so to be there at the size of a stone too, and at that of the wall.
pub(super) fn shared_variance(stones: &[&Equations], correlation: &Correlation) -> f64 {
    let mut variances: Vec<f64> = stones
        .iter()
        .flat_map(|e| e.coarse_variances.iter().copied())
        .collect();
    median(&mut variances).unwrap_or(0.0) * (correlation.large - correlation.small).max(0.0)
}

/// How much more a stone's cells scatter in what their slopes say than noise alone explains: the ratio of an empirical to a model
/// variance of the motion (White 1980).
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
