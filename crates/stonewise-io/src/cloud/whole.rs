//! Cloud files that appear whole or not at all.

use std::io;
use std::path::Path;

use super::CloudError;
use crate::atomic::write_atomically;

/// [`write_atomically`] for writers whose errors can be cloud errors.
pub(super) fn write_whole<T, E: From<CloudError>>(
    path: &Path,
    write: impl FnOnce(&Path) -> Result<T, E>,
) -> Result<T, E> {
    let written = write_atomically(path, |partial| write(partial).map_err(Stop::Write));
    written.map_err(|stop| match stop {
        Stop::Write(e) => e,
        Stop::Publish(e) => CloudError::write(path, e).into(),
    })
}

/// What can end the writing.
enum Stop<E> {
    Write(E),
    Publish(io::Error),
}

impl<E> From<io::Error> for Stop<E> {
    fn from(error: io::Error) -> Self {
        Self::Publish(error)
    }
}
