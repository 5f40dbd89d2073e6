//! What can be chosen in the matching of stones.

use serde::{Deserialize, Serialize};

/// Parameters of [`crate::matching::match_stones`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
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
    #[serde(deserialize_with = "unlimited")]
    pub max_offset_sizes: f64,
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
    #[serde(deserialize_with = "unlimited")]
    pub min_overlap: f64,
}

impl Default for MatchParams {
    fn default() -> Self {
        Self {
            max_ratio: 0.4,
            min_area_ratio: 0.5,
            max_offset_sizes: 0.5,
            max_shift_m: 1.0,
            shift_neighbours: 16,
            mutual: true,
            min_overlap: 0.75,
        }
    }
}

impl MatchParams {
    /// The paper's own test: ratio 0.4, area ratio 0.95, no shift removed.
    pub fn paper() -> Self {
        Self {
            max_ratio: 0.4,
            min_area_ratio: 0.95,
            max_offset_sizes: f64::INFINITY,
            max_shift_m: 0.0,
            shift_neighbours: 0,
            mutual: false,
            min_overlap: f64::INFINITY,
        }
    }
}

/// JSON has no infinity: `null` stands for "no limit" where results are read again.
fn unlimited<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::INFINITY))
}
