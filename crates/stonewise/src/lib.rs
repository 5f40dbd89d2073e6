//! From surveys to a statement about how a masonry dam moves: the project file, the pipeline, the results.

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

use stonewise_base::{
    address_space, error, files, messages as texts, part, processor, report_params, settings, stable,
    thresholds, warnings,
};
use stonewise_figure as figure;
use stonewise_project::sources;
use stonewise_report::verdict;

pub use adapt::{Adapted, adapt};
pub use address_space::{require as require_memory, require_start};
pub use error::{Error, Result};
pub use output::{OutputFolder, Owner, PREVIOUS_DIR, UNFINISHED_FILE};
pub use part::Part;
pub use pipeline::{
    Comparison, Coordinator, PairSummary, Plan, PlanOptions, Summary, Unit, UnitDone, Until, compare_clouds,
    do_unit, plan, run, tile_clouds,
};
pub use processor::processor_class;
pub use report_params::{Language, ReportParams};
pub use settings::{IngestParams, RegistrationParams, SegmentParams, Settings};
pub use stable::StableArea;
pub use stonewise_project as project;
pub use stonewise_project::{
    Epoch, Halves, Initialised, Project, SPLIT_FILES, ScansProject, check, edits, init, is_scan, split,
};
pub use stonewise_report as report;
pub use stonewise_results as results;
pub use stonewise_results::export;
pub use storage::step::set_program;
pub use thresholds::{Levels, Measures, Thresholds, Zone};
pub use truth::evaluate_truth;
pub use verify::{Answer, Finding, Maker, Verification, verify};
pub use warnings::Warning;
