//! From surveys to a statement about how a masonry dam moves: the project file, the pipeline, the results.

mod error;
pub mod experiment;
mod figure;
mod files;
mod init;
mod limits;
mod part;
mod pipeline;
mod project;
pub mod report;
pub mod segmentation;
pub mod simulate;
mod split;
mod stable;
mod truth;
mod warnings;

pub use error::{Error, Result};
pub use init::init;
pub use part::Part;
pub use pipeline::{Comparison, PairSummary, Summary, Until, compare_clouds, run};
pub use project::{Epoch, Project, RegistrationParams, SegmentParams, Settings, TileParams};
pub use split::split;
pub use stable::StableArea;
pub use truth::evaluate_truth;
pub use warnings::Warning;
