//! What is tuned, and what a grid came to.

use super::Dimension;
use crate::part::Part;

/// What is tuned, on what.
#[derive(Clone, Debug, Default)]
pub struct TuneOptions {
    /// Parameters and their values; [`super::default_grid`] where empty.
    pub grid: Vec<Dimension>,
    /// Points that take part; all where absent.
    pub part: Option<Part>,
    /// Which points and photos go to which half, where the project prescribes no motion.
    pub seed: u64,
}

/// One point of the grid and what it came to.
#[derive(Clone, Debug, PartialEq)]
pub struct TunedPoint {
    /// Values, in the order of the grid's dimensions.
    pub values: Vec<toml::Value>,
    /// Stones of the first epoch.
    pub stones: f64,
    /// Stones of the first epoch that were matched; mean over the motions.
    pub matched: f64,
    /// Stones of the first epoch that were measured; mean over the motions.
    pub measured: f64,
    /// Errors of the measured stones; `None` where there are none.
    pub errors: Option<PointErrors>,
    /// Why the stones could not be measured.
    pub failure: Option<String>,
}

/// Errors of a grid point, all motions together, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointErrors {
    /// RMSE of the norm of the 3D error: what is made small.
    pub rmse_m: f64,
    /// RMSE per axis in the plane of the face, as the paper's in-plane figures.
    pub in_plane_m: f64,
    /// RMSE out of the plane.
    pub out_of_plane_m: f64,
    /// 95th percentile of the norm, the worst motion's.
    pub p95_m: f64,
    /// Share of stones that are wrong by more than `outlier_m`.
    pub outlier_rate: f64,
}

/// A finished grid.
#[derive(Clone, Debug)]
pub struct Tuned {
    /// Its dimensions.
    pub grid: Vec<Dimension>,
    /// All points, the last dimension changing fastest.
    pub points: Vec<TunedPoint>,
    /// Indices of the points that no other beats in error and number of stones, ascending by number of
    /// stones.
    pub front: Vec<usize>,
    /// The point on the front with the lowest error among those with at least 95 % of the most stones.
    pub recommended: Option<usize>,
    /// Lines for the project file that set the recommended values.
    pub lines: String,
}
