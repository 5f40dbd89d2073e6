//! What results, report, project and pipeline share: errors, warnings, messages, parameters, small files.
//!
//! Programs that use stonewise take these from the crate `stonewise`, which names them again. Parameters are
//! checked as those of a project file are.

pub mod address_space;
pub mod error;
pub mod files;
mod language;
pub mod messages;
mod parameters;
pub mod part;
pub mod processor;
pub mod profile;
pub mod report_params;
pub mod settings;
pub mod stable;
pub mod thresholds;
pub mod warnings;
