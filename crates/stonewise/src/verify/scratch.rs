//! A folder among the system's temporary files.

use crate::error::{Error, Result};
use tempfile::TempDir;

/// A new, empty folder, which goes when it is no longer needed.
pub(super) fn scratch() -> Result<TempDir> {
    tempfile::tempdir().map_err(Error::io("making a temporary folder", &std::env::temp_dir()))
}
