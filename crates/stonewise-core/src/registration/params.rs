//! Parameters and results of the network adjustment.

use super::hyper::VarianceComponents;
use crate::id::StoneId;
use crate::stone::PairResult;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Parameters of [`super::adjust`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NetworkParams {
    /// Cell of the stones' surface grid in median point spacings of the sparser epoch.
    pub cell_spacings: f64,
    /// Smallest cell, metres: finer than a scanner's footprint shows nothing.
    pub min_cell_m: f64,
    /// Longest side of a piece of a face, cells; longer costs time and gains nothing measurable.
    pub patch_cells: usize,
    /// Residuals beyond this many sigmas lose weight.
    pub outlier_sigmas: f64,
    /// Points that a stone needs in each epoch.
    pub min_points: usize,
    /// Share of the face that both epochs must show.
    pub min_overlap: f64,
    /// Neighbours in each of the four directions along the face.
    pub neighbours_per_side: usize,
    /// Expected share of loose stones.
    pub loose_share: f64,
    /// Typical motion of a loose stone, metres.
    pub loose_move_m: f64,
    /// Typical rotation of a loose stone, radians.
    pub loose_turn_rad: f64,
    /// Share of false discoveries that is accepted among the stones called loose.
    pub false_discovery_rate: f64,
    /// Degrees of freedom of the ties between neighbours; fewer let the field break more easily.
    pub tie_freedom: f64,
    /// Share of a point's noise that no number of points averages away (range bias, drift of a scan line or
    /// strip): added across the face to every stone's uncertainty.
    pub systematic_share: f64,
    /// A motion with a direction less certain than this, metres, is reported as not observable.
    pub max_sd_m: f64,
    /// Largest step of a stone in an iteration, metres: within the reach of the stones' relief.
    pub max_step_m: f64,
    /// Iteration stops when no stone moves by more, metres.
    pub tolerance_m: f64,
    /// Most iterations.
    pub max_iterations: usize,
}

impl Default for NetworkParams {
    fn default() -> Self {
        Self {
            cell_spacings: 2.0,
            min_cell_m: 0.003,
            patch_cells: 24,
            outlier_sigmas: 3.5,
            min_points: 25,
            min_overlap: 0.3,
            neighbours_per_side: 2,
            loose_share: 0.03,
            loose_move_m: 0.015,
            loose_turn_rad: 0.02,
            false_discovery_rate: 0.05,
            tie_freedom: 3.0,
            systematic_share: 0.05,
            max_sd_m: 0.02,
            max_step_m: 0.015,
            tolerance_m: 1e-6,
            max_iterations: 32,
        }
    }
}

/// What the adjustment found.
#[derive(Clone, Debug)]
pub struct NetworkReport {
    /// One result per pair, in the source's order.
    pub results: Vec<PairResult>,
    /// Noise of the points along the normal per epoch, metres.
    pub sigma_m: [f64; 2],
    /// Roughness of the stones: standard deviation of a second difference over one cell, metres.
    pub roughness_m: f64,
    /// Cell of the surface grid, metres.
    pub cell_m: f64,
    /// Factor by which correlation between points raises variances; 1 for independent noise.
    pub correlation_factor: f64,
    /// How unlike neighbours move.
    pub components: VarianceComponents,
    /// Mean motion of all stones, world, metres: a check of the datum.
    pub common_motion: Vector3<f64>,
    /// Covariance of the mean motion, m^2, stones correlated as the field has them; without registration error of the epochs.
    pub common_covariance: Matrix3<f64>,
    /// Iterations made.
    pub iterations: usize,
    /// Whether the last iteration moved no stone beyond the tolerance.
    pub converged: bool,
    /// Number of loose stones.
    pub loose: usize,
    /// Neighbours between which the field broke.
    pub breaks: Vec<Break>,
}

/// Two neighbouring stones between which the field of motion is broken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Break {
    /// Stone of the first epoch on one side.
    pub from: StoneId,
    /// Stone of the first epoch on the other side.
    pub to: StoneId,
    /// Jump of the motion from one to the other beyond what the field's gradient explains, world, metres.
    pub jump: Vector3<f64>,
}
