//! The project file: which surveys, and every parameter of every step; how it comes about, and whether its surveys are sound.
//!
//! ```
//! use stonewise_project::{Project, init};
//! # let survey = tempfile::tempdir()?;
//! # for epoch in ["2024", "2025"] {
//! #     std::fs::create_dir(survey.path().join(epoch))?;
//! #     std::fs::write(survey.path().join(epoch).join("wall.xyz"), "1 2 3\n")?;
//! # }
//! # let survey = survey.path();
//! // A folder with the folders 2024 and 2025, in each a cloud.
//! let project = Project::read(&init(survey)?.path)?;
//! assert_eq!(project.epochs.reference().name, "2024");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod check;
mod conditions;
mod dated_csv;
pub mod edits;
mod init;
mod instruments;
mod project_file;
mod project_parameters;
mod project_type;
mod scans;
mod schema;
pub mod sources;
mod split;

pub use conditions::{ConditionsAt, ConditionsFile};
pub use init::{Initialised, Proposal, init, propose};
pub use instruments::{AxisMotion, Instrument, InstrumentFile, ReadingGap};
pub use project_type::{Epoch, PhotoFiles, Project};
pub use scans::{ScansProject, is_scan};
pub use schema::project_schema;
pub use split::{Halves, SPLIT_FILES, split};
