//! What is varied, and the points of the curves.

use super::cases::Influence;

/// What is varied, on what.
#[derive(Clone, Debug)]
pub struct SensitivityOptions {
    /// Influences; all where empty.
    pub influences: Vec<Influence>,
    /// Width and height of the simulated wall, metres.
    pub size_m: [f64; 2],
    /// Number of walls; figures are pooled over them.
    pub seeds: u64,
    /// Whether the paper's matching and estimator are measured too.
    pub with_paper: bool,
}

/// One point of a curve: a variant with a scanner and a method, all walls together.
#[derive(Clone, Debug, PartialEq)]
pub struct SensitivityPoint {
    /// What is varied.
    pub influence: Influence,
    /// Which curve of it; empty where there is one.
    pub kind: String,
    /// `TLS` or `UAV`.
    pub scanner: String,
    /// `stonewise` or `paper`.
    pub method: String,
    /// Place on the axis: mean IoU, mm, px or photos.
    pub x: f64,
    /// Stones that count, and those that were measured.
    pub stones: [usize; 2],
    /// RMSE of the 3D error, per axis in the plane, out of the plane, metres; NaN without measured stones.
    pub rmse_m: [f64; 3],
    /// Median of the 3D error, metres.
    pub median_m: f64,
    /// Share of measured stones that are wrong by more than 1 cm.
    pub outlier_rate: f64,
}

impl SensitivityPoint {
    /// Share of the stones that were measured.
    pub fn found_share(&self) -> f64 {
        self.stones[1] as f64 / self.stones[0].max(1) as f64
    }
}
