//! What the combinations of a grid came to.

use stonewise_core::evaluate::{Directions, ErrorStatistics, MotionScore};

/// One combination and what it came to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TunedPoint {
    /// Values, in the order of the grid's dimensions.
    pub values: Vec<toml::Value>,
    /// Stones of the first epoch.
    pub stones: f64,
    /// Stones of the first epoch that were matched; mean over the motions.
    pub matched: f64,
    /// Stones of the first epoch that were measured; mean over the motions.
    pub measured: f64,
    /// Errors of the measured stones, for each motion that could be measured.
    pub scores: Vec<MotionScore>,
    /// Why the stones could not be measured.
    pub failure: Option<String>,
}

impl TunedPoint {
    /// RMSE of the norm of the 3D error over all motions, metres: what is made small.
    pub fn rmse_m(&self) -> Option<f64> {
        let square = self.mean(|d| d.norm_3d.as_ref(), |e| e.rmse_m.powi(2));
        square.map(f64::sqrt)
    }

    /// A figure of the errors in a direction: the mean over the motions, weighted by their stones; `None` where a motion
    /// could not be measured.
    pub(super) fn mean(
        &self,
        direction: fn(&Directions) -> Option<&ErrorStatistics>,
        of: fn(&ErrorStatistics) -> f64,
    ) -> Option<f64> {
        let all = || self.scores.iter().filter_map(|s| direction(&s.errors));
        let count: usize = all().map(|e| e.count).sum();
        let sum: f64 = all().map(|e| of(e) * e.count as f64).sum();
        (count > 0 && self.failure.is_none()).then(|| sum / count as f64)
    }
}

/// A finished grid.
#[derive(Clone, Debug)]
pub struct Tuned {
    /// All combinations, the last dimension changing fastest.
    pub points: Vec<TunedPoint>,
    /// The one with the lowest error among those with at least 95 % of the most stones; of equal ones the one that changes
    /// the fewest parameters.
    pub recommended: Option<usize>,
    /// Lines for the project file that set the recommended values.
    pub lines: String,
}
