//! Simulated surveys as files, which enter through the same door as real ones.

mod clouds;
mod params;
mod photo_masks;
mod photos;
mod project_file;
mod survey;
mod truth;
mod unfinished;
mod write;

pub use crate::simulate_error::SimulateError;
pub use params::{MaskFiles, SurveyParams};
pub use write::{SurveySummary, write_survey};
