//! Training: images in, weights out, in as many runs of the program as it takes.

mod checkpoint;
mod curve;
mod curve_columns;
mod error;
mod optimizer;
mod params;
mod plot;
mod rendered;
mod run;
mod schedule;
mod source;
mod start;
pub mod synth;
mod trainer;

pub use checkpoint::checkpoint_path;
pub use error::TrainError;
pub use optimizer::{AdamW, AdamWParams};
pub use params::{TrainConfig, TrainParams};
pub use rendered::Rendered;
pub use run::{Run, Stop, evaluate_samples, model_path};
pub use schedule::{Elapsed, Schedule, Total};
pub use source::SampleSource;
pub use start::{Start, open_training};
pub use trainer::{StepFigures, Trainer};

#[cfg(test)]
mod tests;
