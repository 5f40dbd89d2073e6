//! The stones of a photo.

use std::collections::BTreeMap;
use stonewise_core::raster::LabelImage;

/// The stones that were found in a photo; every pixel belongs to one at most.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmentation {
    /// Stone of every pixel, 0 where there is none.
    pub labels: LabelImage,
    /// How sure the detector is of each stone, 0 to 1.
    pub scores: BTreeMap<u32, f32>,
}
