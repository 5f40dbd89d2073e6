//! Converts errors of the LAS library.

use std::path::Path;

use crate::cloud::CloudError;

/// An error that names the file.
pub fn las_error(path: &Path, error: las::Error) -> CloudError {
    match error {
        las::Error::Io(e) | las::Error::LasZipError(laz::LasZipError::IoError(e)) => {
            CloudError::read(path, e)
        }
        other => CloudError::malformed(path, other.to_string()),
    }
}
