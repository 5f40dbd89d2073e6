//! Surveys made up from scratch, with truth: walls, motions, scanners and cameras, and the files that a survey
//! consists of, which enter through the same door as real ones.
//!
//! `world` makes clouds, photos and masks in memory; `files` writes them. Lengths are metres, angles radians;
//! equal parameters give equal bytes for any number of threads.
//!
//! ```
//! use stonewise_simulate::{SurveyParams, World};
//!
//! let world = World::new(&SurveyParams::demo().scene.seeded(7));
//! let motion = &world.motions[0];
//! println!("{} stones; the first moves by {:?} m", world.wall.stones.len(), motion);
//! # assert_eq!(world.wall.stones.len(), world.motions.len());
//! ```

mod files;
mod world;

pub use files::{MaskFiles, SimulateError, SurveyParams, SurveySummary, write_survey};
pub use world::*;
