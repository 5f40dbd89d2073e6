//! Simulated surveys as files, which enter through the same door as real ones.

mod clouds;
mod memory;
mod params;
mod photo_masks;
mod photos;
mod project_file;
mod survey;
mod truth;
mod unfinished;
mod write;

pub use crate::simulate_error::SimulateError;
pub use memory::require_memory;
pub use params::{MaskFiles, SurveyParams};
pub use write::{SurveySummary, write_survey};
