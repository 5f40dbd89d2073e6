//! A photo whose stones are known.

use stonewise_core::raster::{LabelImage, Raster, RgbImage};

/// An image with its stones, for training and evaluation.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    image: RgbImage,
    labels: LabelImage,
    ignore: Raster<bool>,
}

/// The parts of a sample do not fit together.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("image, labels and ignored region differ in size: {0:?}, {1:?}, {2:?} pixels")]
pub struct SampleError([u32; 2], [u32; 2], [u32; 2]);

impl Sample {
    /// A sample of an image, the stone of every pixel (0 = none), and the pixels about which nothing is known: there an
    /// unlabelled pixel may be a stone.
    ///
    /// # Errors
    /// The three differ in size.
    pub fn new(image: RgbImage, labels: LabelImage, ignore: Raster<bool>) -> Result<Self, SampleError> {
        let sizes = (
            [image.width(), image.height()],
            [labels.width(), labels.height()],
            [ignore.width(), ignore.height()],
        );
        if sizes.0 != sizes.1 || sizes.0 != sizes.2 {
            return Err(SampleError(sizes.0, sizes.1, sizes.2));
        }
        Ok(Self {
            image,
            labels,
            ignore,
        })
    }

    /// The photo.
    pub fn image(&self) -> &RgbImage {
        &self.image
    }

    /// Stone of every pixel, 0 where there is none.
    pub fn labels(&self) -> &LabelImage {
        &self.labels
    }

    /// True where nothing is known.
    pub fn ignore(&self) -> &Raster<bool> {
        &self.ignore
    }
}
