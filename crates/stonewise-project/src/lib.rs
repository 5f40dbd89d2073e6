//! The project file: which surveys, and every parameter of every step; how it comes about, and whether its surveys are sound.

pub mod check;
mod conditions;
mod day;
pub mod edits;
mod init;
mod project_file;
mod project_parameters;
mod project_type;
mod scans;
mod schema;
pub mod sources;
mod split;

pub use day::{DAYS_A_YEAR, day_of};
pub use init::{Initialised, Proposal, init, propose};
pub use project_type::{Epoch, PhotoFiles, Project};
pub use scans::{ScansProject, is_scan};
pub use schema::project_schema;
pub use split::{Halves, SPLIT_FILES, split};
