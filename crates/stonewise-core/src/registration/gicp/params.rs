//! Parameters of plane-to-plane ICP.

use crate::params::{Params, Range, Ranged, with_ranges};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of [`super::align`] and [`super::relate_to_neighbours`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct GicpParams {
    /// Points within this distance of any point of the stone take part, metres. 0.6 as in the paper; 0 leaves
    /// the stone's own points.
    pub buffer_m: f64,
    /// Points further apart do not correspond, metres. 0.1 is twice the largest motion of the paper's
    /// experiment.
    pub max_distance_m: f64,
    /// Edge of the voxels of which both clouds keep one point each, metres. 0: all points, as in the paper.
    /// 0.01 takes a quarter of the time on clouds of 4 mm.
    pub voxel_m: f64,
    /// Neighbours to which the plane of a point is fitted, itself included. 20 as in Segal, Haehnel & Thrun
    /// (2009).
    pub plane_neighbours: usize,
    /// Variance across a plane relative to the variance along it. 1e-3 as in Segal, Haehnel & Thrun (2009).
    pub plane_epsilon: f64,
    /// A step that moves no point by more than this ends the iteration, metres. 1e-6: the millimetre that is
    /// common elsewhere biases the answer by half a millimetre.
    pub tolerance_m: f64,
    /// Most iterations. On smooth faces steps along the face shrink slowly; rough
    /// masonry needs less than half of 400.
    pub max_iterations: usize,
    /// Points that a stone needs in each epoch, and pairs that an alignment needs. 25: four for each unknown.
    pub min_points: usize,
    /// Share of the window's points that must find a partner. 0.3: below it the epochs show different things.
    pub min_overlap: f64,
    /// Smallest observability (`sep_obs` of the stone table) at which a motion is reported. 0.01: relief with a slope
    /// of 1 % of the whole window, after the apparent slope of the noise is taken off.
    pub min_observability: f64,
    /// Cell within which residuals may be correlated, metres. 0.05: twice the usual support of a plane.
    pub correlation_cell_m: f64,
    /// Nearest stones that a stone is compared with. 8: one ring around it.
    pub neighbours: usize,
    /// Share of false discoveries that is accepted among the stones called loose. 0.05 as everywhere in the
    /// project.
    pub false_discovery_rate: f64,
}

impl Default for GicpParams {
    fn default() -> Self {
        Self {
            buffer_m: 0.6,
            max_distance_m: 0.1,
            voxel_m: 0.0,
            plane_neighbours: 20,
            plane_epsilon: 1e-3,
            tolerance_m: 1e-6,
            max_iterations: 400,
            min_points: 25,
            min_overlap: 0.3,
            min_observability: 0.01,
            correlation_cell_m: 0.05,
            neighbours: 8,
            false_discovery_rate: 0.05,
        }
    }
}

impl Params for GicpParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::NOT_NEGATIVE.holds("buffer_m", self.buffer_m),
            Range::POSITIVE.holds("max_distance_m", self.max_distance_m),
            Range::NOT_NEGATIVE.holds("voxel_m", self.voxel_m),
            Range::POSITIVE.holds("plane_neighbours", self.plane_neighbours),
            Range::POSITIVE.holds("plane_epsilon", self.plane_epsilon),
            Range::POSITIVE.holds("tolerance_m", self.tolerance_m),
            Range::POSITIVE.holds("max_iterations", self.max_iterations),
            Range::NOT_NEGATIVE.holds("min_points", self.min_points),
            Range::SHARE.holds("min_overlap", self.min_overlap),
            Range::NOT_NEGATIVE.holds("min_observability", self.min_observability),
            Range::POSITIVE.holds("correlation_cell_m", self.correlation_cell_m),
            Range::NOT_NEGATIVE.holds("neighbours", self.neighbours),
            Range::SHARE.holds("false_discovery_rate", self.false_discovery_rate),
        ]
    }
}
