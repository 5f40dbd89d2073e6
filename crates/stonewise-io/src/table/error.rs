//! What can go wrong with tables.

use std::io;
use std::path::{Path, PathBuf};

/// Why a table could not be built, read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// A column does not fit the others.
    #[error("column {name:?} has {rows} rows, but the table has {expected}")]
    Rows {
        /// The column.
        name: String,
        /// Its length.
        rows: usize,
        /// The length of the table.
        expected: usize,
    },
    /// Two columns with the same name.
    #[error("column {0:?} occurs twice")]
    Duplicate(String),
    /// A required column is missing.
    #[error("column {name:?} is missing; the table has: {}", .present.join(", "))]
    Missing {
        /// The column.
        name: String,
        /// The columns of the table.
        present: Vec<String>,
    },
    /// A column has the wrong type.
    #[error("column {name:?} holds {found}, not {expected}")]
    Type {
        /// The column.
        name: String,
        /// Type in the table.
        found: &'static str,
        /// Type that was to be read.
        expected: &'static str,
    },
    /// A column has empty cells where none are allowed.
    #[error("column {0:?} has empty cells")]
    Empty(String),
    /// Not a Parquet file, damaged, or with content that a table cannot hold.
    #[error("{}: cannot read it: {reason}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The file could not be written.
    #[error("{}: cannot write it: {reason}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The operating system refused.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl TableError {
    pub(super) fn unwritable(path: &Path, reason: impl ToString) -> Self {
        Self::Write {
            path: path.to_owned(),
            reason: reason.to_string(),
        }
    }
}
