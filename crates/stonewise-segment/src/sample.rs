//! A photo whose stones are known.

use stonewise_core::raster::{LabelImage, Raster, ReliefMap, RgbImage};

/// An image with its stones, for training and evaluation.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    image: RgbImage,
    labels: LabelImage,
    ignore: Raster<bool>,
    relief: Option<ReliefMap>,
}

/// The parts of a sample do not fit together.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("image, labels and ignored region differ in size: {0:?}, {1:?}, {2:?} pixels")]
pub struct SampleError([u32; 2], [u32; 2], [u32; 2]);

impl Sample {
    /// A sample of an image, the stone of every pixel (0 = none), and the pixels about which nothing is
    /// known: there an unlabelled pixel may be a stone.
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
            relief: None,
        })
    }

    /// A sample from the colour, the stone and the doubt of every pixel, by its row-major index.
    pub(crate) fn from_pixels(
        width: u32,
        height: u32,
        mut pixel: impl FnMut(usize) -> ([u8; 3], u32, bool),
    ) -> Self {
        let mut sample = Self {
            image: Raster::filled(width, height, [0; 3]),
            labels: Raster::filled(width, height, 0),
            ignore: Raster::filled(width, height, false),
            relief: None,
        };
        let parts = sample
            .image
            .data_mut()
            .iter_mut()
            .zip(sample.labels.data_mut())
            .zip(sample.ignore.data_mut());
        for (i, ((colour, label), doubt)) in parts.enumerate() {
            (*colour, *label, *doubt) = pixel(i);
        }
        sample
    }

    /// Sets the relief of the photo, which a point cloud shows; the map may have any resolution.
    #[must_use]
    pub fn with_relief(self, relief: Option<ReliefMap>) -> Self {
        Self { relief, ..self }
    }

    /// The photo.
    pub fn image(&self) -> &RgbImage {
        &self.image
    }

    /// Stone of every pixel, 0 where there is none.
    pub fn labels(&self) -> &LabelImage {
        &self.labels
    }

    /// What a cloud says about its surface, where there is one.
    pub fn relief(&self) -> Option<&ReliefMap> {
        self.relief.as_ref()
    }

    /// True where nothing is known.
    pub fn ignore(&self) -> &Raster<bool> {
        &self.ignore
    }
}
