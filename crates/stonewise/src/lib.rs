//! From surveys to a statement about how a masonry dam moves: the project file, the pipeline, the results.
//!
//! [`run`] is the whole chain, [`compare_clouds`] M3C2, C2C and C2M of two clouds, [`nalgebra`] the one that the types
//! are made of. Below it, each of use without the others: `stonewise_core` (the algorithms, in memory),
//! `stonewise_io` (clouds, cameras, masks, tables), `stonewise_segment` (stones in photos), `stonewise_simulate`
//! (surveys with known truth).
//!
//! ```no_run
//! use stonewise::{OutputFolder, Project, Until, results::ResultSet, run};
//! use stonewise_core::progress::Silent;
//!
//! let project = Project::read("survey/stonewise.toml".as_ref())?;
//! let folder = OutputFolder::of_project("results".as_ref(), &project, false)?;
//! run(&project, &folder, Until::Reported, &Silent)?;
//! for stone in &ResultSet::read(folder.path())?.stones {
//!     println!("{} {:?}", stone.stone_id, stone.motion.as_ref().map(|m| m.displacement));
//! }
//! # Ok::<(), stonewise::Error>(())
//! ```

mod adapt;
pub mod experiment;
mod kept;
mod output;
mod pipeline;
pub mod segmentation;
mod storage;
#[cfg(test)]
#[path = "../../../testing/results.rs"]
mod testing;
mod truth;
mod verify;
mod watched;

use stonewise_base::{
    address_space, error, files, messages as texts, part, processor, report_params, settings, stable,
    thresholds, warnings,
};
use stonewise_figure as figure;
use stonewise_project::sources;
use stonewise_report::verdict;

pub use adapt::{Adapted, Agreement, Fate, StoneChange, Taught, adapt, keep_detector, teach};
pub use address_space::{require as require_memory, require_start};
pub use error::{Error, Result};
pub use files::read_toml;
pub use output::{OutputFolder, Owner, PREVIOUS_DIR, UNFINISHED_FILE};
pub use part::Part;
pub use pipeline::{
    Comparison, Coordinator, PROJECT_STEP, PairSummary, Plan, Summary, Unit, UnitDone, Until, compare_clouds,
    do_unit, plan, run, tile_clouds,
};
pub use processor::processor_class;
pub use report_params::{Language, ReportParams};
pub use settings::{IngestParams, RegistrationParams, SegmentParams, Settings};
pub use stable::StableArea;
pub use stonewise_core::nalgebra;
pub use stonewise_project as project;
pub use stonewise_project::{
    Epoch, Halves, Initialised, Project, SPLIT_FILES, ScansProject, check, edits, init, is_scan, split,
};
pub use stonewise_report as report;
pub use stonewise_results as results;
pub use stonewise_results::export;
pub use storage::step::set_program;
pub use thresholds::{Level, Quantity, Threshold, Thresholds, Zone};
pub use truth::evaluate_truth;
pub use verify::{Answer, Finding, Maker, Verification, verify};
pub use warnings::Warning;
pub use watched::{PartShown, StepShown, StepState, Steps, Told, told};
