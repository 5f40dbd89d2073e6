//! The command, run as a user runs it.
#![allow(
    clippy::panic,
    clippy::print_stderr,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a test that cannot go on must stop"
)]

mod certify;
mod check;
mod design;
mod edits;
mod faults;
mod frames;
mod inputs;
mod installed;
mod kill;
mod life;
mod output_folder;
mod scans;
mod series;
mod split;
mod studio;
mod support;
mod survey;
mod transcripts;
mod units;
mod verdict;
mod verify;
