//! The pipeline on small surveys.
#![allow(
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test that cannot go on must stop"
)]

mod adapt;
mod carry;
mod experiments;
#[path = "../../../stonewise-segment/tests/integration/narrow_model/mod.rs"]
mod narrow_model;
mod relief;
mod segment_folder;
