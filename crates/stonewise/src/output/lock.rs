//! One run at a time in an output folder.

use crate::error::{Error, Result};
use crate::results::names::WORK_DIR;
use std::fs::{self, File, TryLockError};
use std::path::Path;

/// The file that is locked; it stays behind empty and means nothing then.
pub(super) const LOCK_FILE: &str = "lock";

/// Holds an output folder for this process. The system releases it with the process, however that ends.
#[derive(Debug)]
pub(super) struct FolderLock {
    _file: File,
}

impl FolderLock {
    /// Locks a folder, which exists.
    ///
    /// Errors: another process, or another run of this one, holds it; the file system has no locks.
    pub fn take(folder: &Path) -> Result<Self> {
        let work = folder.join(WORK_DIR);
        fs::create_dir_all(&work).map_err(Error::io("making a folder", &work))?;
        let path = work.join(LOCK_FILE);
        let file = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .map_err(Error::io("opening", &path))?;
        match file.try_lock() {
            Ok(()) => Ok(Self { _file: file }),
            Err(TryLockError::WouldBlock) => Err(Error::Busy {
                path: folder.to_path_buf(),
            }),
            Err(TryLockError::Error(source)) => Err(Error::Io {
                action: "locking the results folder (it must lie where files can be locked, such as a local disk)",
                path,
                source,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_one_holder_until_it_is_let_go() {
        let folder = tempfile::tempdir().unwrap();
        let held = FolderLock::take(folder.path()).unwrap();
        let message = FolderLock::take(folder.path()).unwrap_err().to_string();
        assert!(message.contains("another run works in this folder"), "{message}");
        drop(held);
        FolderLock::take(folder.path()).unwrap();
    }
}
