//! The project file: which surveys, and every parameter of every step; how it comes about, and whether its surveys are sound.

pub mod check;
mod conditions;
mod dated_csv;
mod distances;
pub mod edits;
mod init;
mod instruments;
mod networks;
mod origin;
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
pub use networks::{NetworkFile, NetworkMotion, PointMotion};
pub use project_type::{Distance, Epoch, Origin, PhotoChoice, PhotoFiles, Project};
pub use scans::{ScansProject, is_scan};
pub use schema::project_schema;
pub use split::{Halves, SPLIT_FILES, split};
