//! What can be chosen in the matching of stones.

use crate::params::{Params, Range, Ranged, with_ranges};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of [`crate::matching::match_stones`]. Without `max_offset_sizes` a match may be at any distance;
/// without `min_overlap`, overlap makes no pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct MatchParams {
    /// Largest ratio of the distances to the nearest and the second nearest centroid. 0.4: the paper's
    /// Equation 2.
    pub max_ratio: f64,
    /// Least ratio of the smaller to the larger face area. 0.5: a stone of 20 pixels across whose mask is one
    /// pixel too wide has 0.8, one with a part hidden in one epoch 0.6; two equal stones that a mask merges
    /// have 0.5, but their common centroid lies between them. The paper's 0.95 loses most stones with masks
    /// that are not exact.
    pub min_area_ratio: f64,
    /// Largest distance of a match after the local shift, in units of the square root of the larger area.
    /// 0.5: the centroid stays within the stone.
    pub max_offset_sizes: Option<f64>,
    /// Largest common motion that is looked for, metres; 0 for none. 1: several stones.
    pub max_shift_m: f64,
    /// Matched neighbours whose median is the local shift; 0 for none. 16: two rings of neighbours, of which
    /// half may be wrong or loose.
    pub shift_neighbours: usize,
    /// Whether each of the two must be the other's nearest. The paper does not require it.
    pub mutual: bool,
    /// Least overlap, where the caller can tell it, that makes a pair of two stones that centroids and areas
    /// leave alone: ambiguous ones, and stones that one epoch shows only in part. 0.75: of a stone and one
    /// that a mask merges with an equal neighbour two thirds of the cells agree.
    pub min_overlap: Option<f64>,
}

impl Default for MatchParams {
    fn default() -> Self {
        Self {
            max_ratio: 0.4,
            min_area_ratio: 0.5,
            max_offset_sizes: Some(0.5),
            max_shift_m: 1.0,
            shift_neighbours: 16,
            mutual: true,
            min_overlap: Some(0.75),
        }
    }
}

impl Params for MatchParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::POSITIVE.holds("max_ratio", self.max_ratio),
            Range::SHARE.holds("min_area_ratio", self.min_area_ratio),
            Range::NOT_NEGATIVE.holds("max_offset_sizes", self.max_offset_sizes),
            Range::NOT_NEGATIVE.holds("max_shift_m", self.max_shift_m),
            Range::NOT_NEGATIVE.holds("shift_neighbours", self.shift_neighbours),
            Range::SHARE.holds("min_overlap", self.min_overlap),
        ]
    }
}

impl MatchParams {
    /// Largest distance, metres, of a match of stones whose larger area is this, m^2.
    pub(super) fn max_offset_m(&self, area_m2: f64) -> f64 {
        self.max_offset_sizes.unwrap_or(f64::INFINITY) * area_m2.sqrt()
    }

    /// The paper's own test: ratio 0.4, area ratio 0.95, no shift removed.
    pub fn paper() -> Self {
        Self {
            max_ratio: 0.4,
            min_area_ratio: 0.95,
            max_offset_sizes: None,
            max_shift_m: 0.0,
            shift_neighbours: 0,
            mutual: false,
            min_overlap: None,
        }
    }
}
