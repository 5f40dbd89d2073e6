//! Simulated surveys as files.

mod clouds;
mod error;
mod memory;
mod params;
mod photo_masks;
mod photos;
mod project_file;
mod survey;
mod truth;
mod unfinished;
mod write;

pub use error::SimulateError;
pub use params::{MaskFiles, SurveyParams};
pub use write::{SurveySummary, write_survey};
