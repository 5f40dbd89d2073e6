//! Messages about files of parameters.

use std::fmt::Display;
use std::path::Path;

/// An error in a file of parameters, with the name of the file.
pub fn in_file<E: Display>(path: &Path) -> impl FnOnce(E) -> stonewise::Error {
    move |error| stonewise::Error::Parameters(format!("{error}: {}", path.display()))
}
