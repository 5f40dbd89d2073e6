//! The instances of one photo.

use stonewise_core::raster::LabelImage;

/// The instances of one photo.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledPhoto {
    /// Instance of every pixel, 0 where there is none.
    pub labels: LabelImage,
    /// What is known of each label that occurs, in rising order of id.
    pub instances: Vec<InstanceInfo>,
    /// Masks that were left out, and why.
    pub warnings: Vec<String>,
}

/// What a mask file says about an instance besides its pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct InstanceInfo {
    /// Label in the image; never 0.
    pub id: u32,
    /// How sure the segmentation was, 0 to 1; 1 where the file does not say.
    pub score: f64,
    /// The true stone, if the file has the extra key `stone_id`; for evaluation only.
    pub stone_ref: Option<u64>,
}
