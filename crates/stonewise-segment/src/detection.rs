//! What a detector says about a photo.

use stonewise_core::raster::{Raster, ReliefMap, RgbImage};

/// One stone found in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Detection {
    /// Left, top, right, bottom; pixel coordinates, pixel (x, y) covers [x, x+1) x [y, y+1).
    pub bounds: [f32; 4],
    /// How sure the detector is, 0 to 1.
    pub score: f32,
    /// Its pixels.
    pub mask: Patch,
}

/// A binary mask on the part of an image that it needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Column of its first pixel in the image.
    pub left: u32,
    /// Row of its first pixel in the image.
    pub top: u32,
    /// True inside the stone.
    pub pixels: Raster<bool>,
}

/// Finds the stones of one image that is small enough to be looked at as a whole.
pub trait Detector: Sync {
    /// What went wrong.
    type Error: Send;

    /// The stones of an image, best score first. `relief`: what a cloud says about the surface that the image
    /// shows, at any resolution, where there is a cloud; a detector that has not learnt relief leaves it
    /// alone.
    ///
    /// # Errors
    /// The detector could not run.
    fn detect(&self, image: &RgbImage, relief: Option<&ReliefMap>) -> Result<Vec<Detection>, Self::Error>;

    /// Whether relief makes a difference.
    fn takes_relief(&self) -> bool {
        false
    }
}
