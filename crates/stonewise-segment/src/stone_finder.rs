//! The detector in use.

use crate::built_in::{Weights, open_model};
use crate::detection::{Detection, Detector};
use crate::model::{MaskRcnn, WeightsError};
use stonewise_core::raster::{ReliefMap, RgbImage};

/// Finds stones with a trained model.
#[derive(Clone, Debug)]
pub struct StoneFinder(MaskRcnn);

impl StoneFinder {
    /// A detector that runs this model.
    pub fn new(model: MaskRcnn) -> Self {
        Self(model.for_inference())
    }

    /// The detector of these weights; stones with a lower score than `min_score` are left out.
    ///
    /// # Errors
    /// The file cannot be read or does not fit.
    pub fn open(weights: &Weights, min_score: f32) -> Result<Self, WeightsError> {
        Ok(Self::new(open_model(weights, false)?.with_min_score(min_score)))
    }

    /// The stones that boxes of an image hold, one a box, in their order ([`MaskRcnn::outline`]).
    pub fn outline(
        &self,
        image: &RgbImage,
        relief: Option<&ReliefMap>,
        boxes: &[[f32; 4]],
    ) -> Vec<Detection> {
        self.0.outline(image, relief, boxes)
    }
}

impl Detector for StoneFinder {
    type Error = std::convert::Infallible;

    fn detect(&self, image: &RgbImage, relief: Option<&ReliefMap>) -> Result<Vec<Detection>, Self::Error> {
        Ok(self.0.detect(image, relief))
    }

    fn takes_relief(&self) -> bool {
        self.0.takes_relief()
    }
}
