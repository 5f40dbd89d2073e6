//! What holds for the sources of all crates, read as text: none of the crates is compiled for it.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test that cannot go on must stop"
)]

mod bundles;
mod layers;
mod module_graph;
