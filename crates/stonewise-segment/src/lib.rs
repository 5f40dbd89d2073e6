//! Finds the stones of masonry in photos: Mask R-CNN (He et al. 2017), its training and its evaluation.

mod detection;
mod sample;

pub use detection::{Detection, Detector, Patch};
pub use sample::{Sample, SampleError};
