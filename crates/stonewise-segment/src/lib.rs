//! Finds the stones of masonry in photos: Mask R-CNN (He et al. 2017), its training and its evaluation.

pub mod augment;
mod built_in;
pub mod dataset;
mod detection;
mod engine;
pub mod evaluation;
mod jpeg;
pub mod model;
mod relief;
mod sample;
mod seed;
mod segmentation;
mod stone_finder;
pub mod tiling;
pub mod train;

pub use built_in::{Weights, open_model};
pub use detection::{Detection, Detector, Patch};
pub use sample::{Sample, SampleError};
pub use segmentation::Segmentation;
pub use stone_finder::StoneFinder;
