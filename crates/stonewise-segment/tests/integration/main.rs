//! The detector against other programs, and what it learns and finds.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on must stop")]

mod average_precision;
mod built_in;
mod efficientnet_lite;
mod learning;
mod narrow_model;
mod relief;
mod synth;
mod torchvision;
