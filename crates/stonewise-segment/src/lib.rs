//! Finds the stones of masonry in photos: Mask R-CNN (He et al. 2017), its training and its evaluation.
//!
//! The stones of a photo of any size, by the detector that comes with the crate. The photo is a rendered one here;
//! `stonewise_io::image_io::read_rgb` reads those of a camera.
//!
//! ```
//! use stonewise_core::progress::Silent;
//! use stonewise_segment::train::synth::masonry_photo;
//! use stonewise_segment::tiling::{TilingOptions, segment_photo};
//! use stonewise_segment::{StoneFinder, Weights};
//!
//! let options = TilingOptions::default();
//! let finder = StoneFinder::open(&Weights::BuiltIn, options.min_score as f32)?;
//! let photo = masonry_photo(9_001, 320, 320);
//! let found = segment_photo(&finder, photo.image(), 1.0, None, &options, &Silent)?;
//! // `labels` has the stone of every pixel, 0 for none.
//! println!("{} stones; the pixel in the corner shows stone {}", found.scores.len(), found.labels.data()[0]);
//! # assert!(found.scores.len() > 3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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
