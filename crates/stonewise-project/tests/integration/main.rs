//! The project file against its page and against what cannot be.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test that cannot go on must stop"
)]

mod hostile_project_files;
mod project_file_page;
