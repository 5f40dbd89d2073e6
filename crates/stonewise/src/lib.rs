//! From surveys to a statement about how a masonry dam moves: the project file, the pipeline, the results.

mod error;
mod init;
mod pipeline;
mod project;
pub mod report;
pub mod simulate;
mod warnings;

pub use error::{Error, Result};
pub use init::init;
pub use pipeline::{Summary, Until, run};
pub use project::{Epoch, Project, RegistrationParams, Settings, TileParams};
pub use warnings::Warning;
