//! Parameters and results of the adjustment.

use super::field::VarianceComponents;
use super::joint_motions::JointMotions;
use super::observation::photo::PhotoReport;
use crate::id::StoneId;
use crate::params::{Params, Range, Ranged, with_ranges};
use crate::stone::{NeighbourCovariance, PairResult};
use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of [`adjust`](crate::registration::adjust).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct AdjustmentParams {
    /// Cell of the stones' surface grid in median point spacings of the sparser epoch. 2: four points a cell,
    /// so that the surface follows relief and not noise.
    pub cell_spacings: f64,
    /// Smallest cell, metres. 0.003: finer than a scanner's footprint shows nothing.
    pub min_cell_m: f64,
    /// Longest side of a piece of a face, cells. 24: the cost of a factor grows with the square of the width,
    /// and longer pieces gain nothing measurable.
    pub patch_cells: usize,
    /// Residuals beyond this many sigmas lose weight. 3.5: one point in 2,000 of normal noise.
    pub outlier_sigmas: f64,
    /// Points that a stone needs in each epoch. 25: four for each unknown of a rigid motion.
    pub min_points: usize,
    /// Share of the face that both epochs must show. 0.3: below it the epochs show different things.
    pub min_overlap: f64,
    /// Neighbours in each of the four directions along the face. 2: the field holds where one neighbour is
    /// missing or loose.
    pub neighbours_per_side: usize,
    /// Whether one epoch may be turned against the other by more than the usual error of a registration (0.1 mrad), as
    /// with drone blocks without control points. The rotation that all stones have in common then counts neither as
    /// strain nor as an error of the clouds. Epochs that are aligned by their stones are always treated this way.
    pub free_rotation: bool,
    /// Expected share of loose stones; where fewer are found, the share is estimated. 0.03: half and twice
    /// change the recall by a tenth at most.
    pub loose_share: f64,
    /// Typical motion of a loose stone, metres. 0.015: about the width of a joint, which is how far it can
    /// go.
    pub loose_move_m: f64,
    /// Typical rotation of a loose stone, radians. 0.02: the same motion at the far end of a stone of 80 cm.
    pub loose_turn_rad: f64,
    /// Share of false discoveries that is accepted among the stones called loose. 0.05 as everywhere in the
    /// project.
    pub false_discovery_rate: f64,
    /// Degrees of freedom of the ties between neighbours; fewer let the field break more easily. 3: the
    /// fewest with a finite variance.
    pub tie_freedom: f64,
    /// Share of a point's noise that no number of points averages away (range bias, drift of a scan line or
    /// strip): added perpendicular to the face to every stone's uncertainty. 0.05: 0.1 mm of a scanner's 2 mm.
    pub systematic_share: f64,
    /// A motion with a direction less certain than this, metres, is reported as not observable. 0.02: more
    /// than loose stones move.
    pub max_sd_m: f64,
    /// Largest step of a stone in an iteration, metres. 0.015: within the reach of the stones' relief.
    pub max_step_m: f64,
    /// Iteration stops when no stone moves by more, metres. 1e-6: a hundredth of the best accuracy of a
    /// stone.
    pub tolerance_m: f64,
    /// Most iterations; each crack that is found adds as many. 32: three times what a wall without cracks
    /// needs.
    pub max_iterations: usize,
}

impl Default for AdjustmentParams {
    fn default() -> Self {
        Self {
            cell_spacings: 2.0,
            min_cell_m: 0.003,
            patch_cells: 24,
            outlier_sigmas: 3.5,
            min_points: 25,
            min_overlap: 0.3,
            neighbours_per_side: 2,
            free_rotation: false,
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

impl Params for AdjustmentParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::POSITIVE.holds("cell_spacings", self.cell_spacings),
            Range::POSITIVE.holds("min_cell_m", self.min_cell_m),
            Range::POSITIVE.holds("patch_cells", self.patch_cells),
            Range::POSITIVE.holds("outlier_sigmas", self.outlier_sigmas),
            Range::NOT_NEGATIVE.holds("min_points", self.min_points),
            Range::SHARE.holds("min_overlap", self.min_overlap),
            Range::NOT_NEGATIVE.holds("neighbours_per_side", self.neighbours_per_side),
            Range::SHARE.holds("loose_share", self.loose_share),
            Range::NOT_NEGATIVE.holds("loose_move_m", self.loose_move_m),
            Range::NOT_NEGATIVE.holds("loose_turn_rad", self.loose_turn_rad),
            Range::SHARE.holds("false_discovery_rate", self.false_discovery_rate),
            Range::NOT_NEGATIVE.holds("tie_freedom", self.tie_freedom),
            Range::SHARE.holds("systematic_share", self.systematic_share),
            Range::NOT_NEGATIVE.holds("max_sd_m", self.max_sd_m),
            Range::POSITIVE.holds("max_step_m", self.max_step_m),
            Range::POSITIVE.holds("tolerance_m", self.tolerance_m),
            Range::POSITIVE.holds("max_iterations", self.max_iterations),
        ]
    }
}

/// What the adjustment found.
#[derive(Clone, Debug)]
pub struct AdjustmentReport {
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
    /// Covariance of the mean motion, m^2, stones correlated as the field has them; without registration
    /// error of the epochs.
    pub common_covariance: Matrix3<f64>,
    /// Iterations made.
    pub iterations: usize,
    /// Whether the stones came to rest: all but a few, which have no motion.
    pub converged: bool,
    /// Number of loose stones.
    pub loose: usize,
    /// Neighbours between which the field broke.
    pub breaks: Vec<Break>,
    /// Covariances of the motions of neighbours relative to each other.
    pub neighbours: Vec<NeighbourCovariance>,
    /// The motions with their joint distribution; `None` where there was no solution.
    pub joint: Option<JointMotions>,
    /// What photos contributed, where they took part.
    pub photos: Option<PhotoReport>,
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
