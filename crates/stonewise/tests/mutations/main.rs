//! Mutated inputs of every reader: an answer or an error that names the file, never a panic, within limits of
//! time and memory.
//!
//! `cargo test` tries the same few inputs each time; `BOLERO_RANDOM_ITERATIONS` says how many instead, and
//! `BOLERO_RANDOM_SEED` where to begin. `cargo bolero test` searches with coverage; see `CONTRIBUTING.md`.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a campaign stops at what it did not expect"
)]

mod campaign;
mod edit;
mod limits;
mod readers;
mod seeds;
mod targets;
