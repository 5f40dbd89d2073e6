//! Methods on whole walls and surveys.
#![allow(
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a test that cannot go on must stop"
)]

mod adjustment;
mod lens;
mod m3c2_py4dgeo;
mod m3c2_survey;
mod matching_walls;
mod outline_survey;
mod outside;
mod photo_adjustment;
mod raster;
mod transfer_scene;
