//! How much less the points say than independent ones would.
//!
//! Scan lines, matching windows and differing stations make neighbouring points err alike. The means of both
//! epochs over small and over larger cells of a face then differ by more than the noise of single points explains.

use super::equations::Equations;
use super::survey::median;

/// Cells that a stone needs to be judged.
const CELLS: usize = 10;
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
}

impl Correlation {
    /// Of independent noise.
    pub const NONE: Self = Self {
        small: 1.0,
        large: 1.0,
    };

    /// `fitted`: how many unknowns each stone's own points determined, which their cells lack.
    pub fn of(stones: &[(&Equations, f64)]) -> Self {
        let at = |cells: fn(&Equations) -> &[f64]| {
            let mut ratios: Vec<f64> = stones
                .iter()
                .filter_map(|(e, fitted)| excess(cells(e), *fitted))
                .collect();
            let middle = median(&mut ratios).filter(|_| ratios.len() >= 10);
            middle.unwrap_or(1.0).max(1.0)
        };
        Self {
            small: at(|e| &e.differences),
            large: at(|e| &e.coarse_differences),
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

/// Mean of a stone's cells over that of independent points, made comparable in the median.
fn excess(cells: &[f64], fitted: f64) -> Option<f64> {
    let freedom = (cells.len() as f64 - fitted).max(1.0);
    let median_of_law = (1.0 - 2.0 / (9.0 * freedom)).powi(3);
    (cells.len() >= CELLS).then(|| cells.iter().sum::<f64>() / freedom / median_of_law)
}
