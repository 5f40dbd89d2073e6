//! stonewise

pub mod report;
