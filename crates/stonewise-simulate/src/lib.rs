//! Surveys made up from scratch, with truth: walls, motions, scanners and cameras, and the files that a survey
//! consists of, which enter through the same door as real ones.
//!
//! `world` makes clouds, photos and masks in memory; `files` writes them. Lengths are metres, angles radians;
//! equal parameters give equal bytes for any number of threads.

mod files;
mod world;

pub use files::{MaskFiles, SimulateError, SurveyParams, SurveySummary, write_survey};
pub use world::*;
