//! The folder that a command writes into: whose it is, who works in it, what in it is current.
//!
//! No command writes over a file that it did not make. [`OutputFolder::claim`] looks before the first byte:
//! inputs must not lie where results go, and a folder that holds anything must carry stonewise's marker of
//! the same project. A lock that the system releases with the process keeps a second run out.

mod claim;
mod digests;
mod inputs;
mod lock;
mod marker;
mod partials;
mod previous;
mod result_names;

pub use claim::OutputFolder;
pub(crate) use digests::Digests;
pub use marker::Owner;
pub use previous::UNFINISHED_FILE;
pub(crate) use previous::{named_results_in, results_in};
pub use result_names::PREVIOUS_DIR;
pub(crate) use result_names::cloud_names;
