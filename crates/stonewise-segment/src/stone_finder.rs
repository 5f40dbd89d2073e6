//! The detector on the backend that the program was built with.

use crate::backend::{Compute, device};
use crate::built_in::{Weights, open_model};
use crate::detection::{Detection, Detector};
use crate::model::{StoneDetector, WeightsError};
use stonewise_core::raster::{ReliefMap, RgbImage};

/// Mask R-CNN on [`Compute`], ready to run.
///
/// The model is generic over burn's backends, so every crate that names a backend compiles all of it again.
/// This type has no parameters: the model is compiled with this crate, once.
#[derive(Clone, Debug)]
pub struct StoneFinder(StoneDetector<Compute>);

impl StoneFinder {
    /// The detector of these weights; stones with a lower score than `min_score` are left out.
    ///
    /// # Errors
    /// The file cannot be read or does not fit.
    pub fn open(weights: &Weights, min_score: f32) -> Result<Self, WeightsError> {
        let model = open_model::<Compute>(weights, &device())?;
        Ok(Self(StoneDetector::new(model).with_min_score(min_score)))
    }
}

impl Detector for StoneFinder {
    type Error = std::convert::Infallible;

    fn detect(&self, image: &RgbImage, relief: Option<&ReliefMap>) -> Result<Vec<Detection>, Self::Error> {
        self.0.detect(image, relief)
    }

    fn takes_relief(&self) -> bool {
        self.0.takes_relief()
    }
}
