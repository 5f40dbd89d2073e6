//! The wall around the LAZ library.

use std::path::Path;

use super::CloudError;
use crate::wall::behind_wall;

/// Runs a step of another library's decoder; a panic in it becomes an error that names the file.
///
/// The LAZ decoder asserts, indexes and subtracts unchecked in places, which damaged bytes can reach.
pub(super) fn guarded<T>(path: &Path, step: impl FnOnce() -> Result<T, CloudError>) -> Result<T, CloudError> {
    behind_wall(step).unwrap_or_else(|| Err(CloudError::malformed(path, "the file is damaged")))
}

/// Guards the LAZ encoder, which can panic on nonsense in records that are copied.
pub(super) fn guarded_write<T>(
    path: &Path,
    step: impl FnOnce() -> Result<T, CloudError>,
) -> Result<T, CloudError> {
    let refused = || CloudError::unwritable(path, "the points cannot be compressed");
    behind_wall(step).unwrap_or_else(|| Err(refused()))
}
