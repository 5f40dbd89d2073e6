//! Finds the stones of masonry in photos: Mask R-CNN (He et al. 2017), its training and its evaluation.

pub mod backend;
mod detection;
pub mod evaluation;
pub mod model;
#[cfg(feature = "onnx")]
pub mod onnx;
mod sample;
mod segmentation;
pub mod synth;
pub mod tiling;
pub mod train;

pub use detection::{Detection, Detector, Patch};
pub use sample::{Sample, SampleError};
pub use segmentation::Segmentation;
