//! A wall around libraries that may panic.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use super::CloudError;

/// Runs a step of another library's decoder; a panic in it becomes an error that names the file.
///
/// The LAZ decoder asserts, indexes and subtracts unchecked in places, which damaged bytes can reach.
/// Whatever the step left behind must not be used after an error.
pub(super) fn guarded<T>(path: &Path, step: impl FnOnce() -> Result<T, CloudError>) -> Result<T, CloudError> {
    catch_unwind(AssertUnwindSafe(step))
        .unwrap_or_else(|_| Err(CloudError::malformed(path, "the file is damaged")))
}

/// The same for the LAZ encoder, which can stumble over nonsense in records that are copied.
pub(super) fn guarded_write<T>(
    path: &Path,
    step: impl FnOnce() -> Result<T, CloudError>,
) -> Result<T, CloudError> {
    let refused = || CloudError::unwritable(path, "the points cannot be compressed");
    catch_unwind(AssertUnwindSafe(step)).unwrap_or_else(|_| Err(refused()))
}
