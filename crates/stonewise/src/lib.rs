//! stonewise

pub mod report;
pub mod simulate;
