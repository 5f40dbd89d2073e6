//! Simulated surveys.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on must stop")]

mod photos;
mod scans;
mod survey_files;
