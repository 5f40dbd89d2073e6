//! From surveys to a statement about how a masonry dam moves: the project file, the pipeline, the results.

mod address_space;
pub mod check;
pub mod edits;
mod error;
pub mod experiment;
pub mod export;
mod figure;
mod files;
mod init;
mod kept;
mod limits;
mod output;
mod parameters;
mod part;
mod pipeline;
mod project;
pub mod report;
mod report_params;
pub mod results;
pub mod segmentation;
mod settings;
pub mod simulate;
mod simulate_error;
mod sources;
mod split;
mod stable;
mod storage;
mod texts;
mod thresholds;
mod truth;
mod verdict;
mod warnings;

pub use address_space::require_start;
pub use error::{Error, Result};
pub use init::{Initialised, init};
pub use output::{OutputFolder, Owner, PREVIOUS_DIR, UNFINISHED_FILE};
pub use part::Part;
pub use pipeline::{
    Comparison, Coordinator, MatchedPair, PairPlaces, PairSummary, Plan, PlanOptions, Stage, Summary, Unit,
    UnitDone, Until, compare_clouds, do_unit, plan, run, tile_clouds,
};
pub use project::{Epoch, Project};
pub use report_params::{Language, ReportParams};
pub use settings::{IngestParams, RegistrationParams, SegmentParams, Settings};
pub use split::{Halves, SPLIT_FILES, split};
pub use stable::StableArea;
pub use storage::step::set_program;
pub use thresholds::{Levels, Measures, Thresholds, Zone};
pub use truth::evaluate_truth;
pub use warnings::Warning;
