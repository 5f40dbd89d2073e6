//! When a stone is carried into another epoch.

use crate::params::{Params, Range, Ranged, with_ranges};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of [`carry_labels`](super::carry_labels).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct CarryParams {
    /// Whether stones of one epoch are corrected by those of others: missed ones are looked for in the cloud, divided
    /// ones are joined, and merged ones are divided. Epochs with masks stay as they are.
    pub enabled: bool,
    /// Largest mean distance, perpendicular to the face, between the surfaces of both epochs in a cell of 3 cm, metres,
    /// after the motion of the neighbours. 0.03: more than the motion of most loose stones, less than the
    /// depth of the hole that a lost stone leaves.
    pub max_height_m: f64,
    /// Least share of the cells of a stone in which the other epoch has points. 0.5: what hides more of the
    /// stone hides its border, too.
    pub min_covered_share: f64,
    /// Least share of these cells in which the surface is the same and belongs to no other stone. 0.75: as
    /// for the overlap of two stones that are paired by it.
    pub min_same_share: f64,
}

impl Default for CarryParams {
    fn default() -> Self {
        Self {
            enabled: true,
            max_height_m: 0.03,
            min_covered_share: 0.5,
            min_same_share: 0.75,
        }
    }
}

impl Params for CarryParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::NOT_NEGATIVE.holds("max_height_m", self.max_height_m),
            Range::SHARE.holds("min_covered_share", self.min_covered_share),
            Range::SHARE.holds("min_same_share", self.min_same_share),
        ]
    }
}
