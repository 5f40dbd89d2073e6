//! What can go wrong with point cloud files.

use std::io;
use std::path::{Path, PathBuf};

/// Why a point cloud could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CloudError {
    /// The operating system refused to read.
    #[error("{}: cannot read it: {source}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error from the system.
        source: io::Error,
    },
    /// The operating system refused to write, for example because the disk is full.
    #[error("{}: cannot write it: {source}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Error from the system.
        source: io::Error,
    },
    /// Neither content nor name identifies the format.
    #[error("{}: unknown point cloud format (known: las, laz, copc, e57, ptx, ply, and text as xyz, txt, csv, asc, pts)", .0.display())]
    UnknownFormat(PathBuf),
    /// A format that is recognised only to say what to give instead.
    #[error("{}: this format is not read: export the cloud as E57, LAZ or PLY", .0.display())]
    NotRead(PathBuf),
    /// The file violates its format, or is damaged.
    #[error("{}: {reason}", .path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Which rule, in words.
        reason: String,
    },
    /// The file ends before its last point.
    #[error("{} is cut off: {reason}", .path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Where it ends.
        reason: String,
    },
    /// A line of a text file is not a point.
    #[error("{}, line {line}: {reason}", .path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: u64,
        /// What is wrong with it.
        reason: String,
    },
    /// The values to write do not fit the points or the format.
    #[error("{}: cannot write it: {reason}", .path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
}

impl CloudError {
    pub(super) fn read(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        if source.kind() == io::ErrorKind::UnexpectedEof {
            let reason = "it ends before its last point".to_owned();
            return Self::Truncated { path, reason };
        }
        Self::Read { path, source }
    }

    pub(super) fn write(path: &Path, source: io::Error) -> Self {
        Self::Write {
            path: path.to_owned(),
            source,
        }
    }

    pub(super) fn malformed(path: &Path, reason: impl Into<String>) -> Self {
        Self::Malformed {
            path: path.to_owned(),
            reason: reason.into(),
        }
    }

    pub(super) fn truncated(path: &Path, reason: impl Into<String>) -> Self {
        Self::Truncated {
            path: path.to_owned(),
            reason: reason.into(),
        }
    }

    pub(super) fn unwritable(path: &Path, reason: impl Into<String>) -> Self {
        Self::Unwritable {
            path: path.to_owned(),
            reason: reason.into(),
        }
    }
}
