//! What can stop a report.

use std::path::PathBuf;
use stonewise_io::layers::LayerError;
use stonewise_io::table::TableError;

/// Why result files could not be written or read, or a report made of them.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A table could not be read or written.
    #[error(transparent)]
    Table(#[from] TableError),
    /// Layers could not be written.
    #[error(transparent)]
    Layers(#[from] LayerError),
    /// A file could not be read or written.
    #[error("{action} failed: {source}: {path}", path = .path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A result file does not hold what it should.
    #[error("{message}; make it anew with `stonewise run`: {path}", path = .path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// There is nothing to report on.
    #[error("no stones.parquet here; give the folder that `stonewise run --out` wrote: {path}", path = .0.display())]
    NoResults(PathBuf),
}

impl ReportError {
    /// Turns a system error into one that names the file.
    pub(super) fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
    }
}
