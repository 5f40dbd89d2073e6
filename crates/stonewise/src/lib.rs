//! From surveys to a statement about how a masonry dam moves: the project file, the pipeline, the results.

mod error;
mod files;
mod init;
mod limits;
mod pipeline;
mod project;
pub mod report;
pub mod simulate;
mod split;
mod truth;
mod warnings;

pub use error::{Error, Result};
pub use init::init;
pub use pipeline::{Comparison, Summary, Until, compare_clouds, run};
pub use project::{Epoch, Project, RegistrationParams, Settings, TileParams};
pub use split::split;
pub use truth::evaluate_truth;
pub use warnings::Warning;
