//! The steps of the method, with their files, and the run that strings them together.

mod clouds_only;
mod clouds_out;
mod compare;
mod context;
mod crs;
mod epoch_tiles;
mod evidence;
mod face_cloud;
mod label;
mod matching;
mod network;
mod pairs;
mod photos;
mod registration;
mod run;
mod run_record;
mod score;
mod series;
mod spill;
pub(crate) mod step;
mod tables;
mod tiled;
mod tiles;
mod windows;

pub use clouds_only::{Comparison, compare_clouds};
pub(crate) use context::Context;
pub(crate) use photos::segment;
pub use run::{PairSummary, Summary, Until, run};
pub(crate) use run::{first_stones, run_in};
pub(crate) use step::{Keeps, Key, StepStore};
