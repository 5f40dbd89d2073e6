//! One run at a time in an output folder.

use crate::error::{Error, Result};
use crate::results::names::WORK_DIR;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

/// The file that is locked, by a run for itself, by units of a plan together; it stays behind empty and means
/// nothing then.
pub(super) const LOCK_FILE: &str = "lock";

/// Holds an output folder for this process. The system releases it with the process, however that ends.
#[derive(Debug)]
pub(super) struct FolderLock {
    _file: File,
}

impl FolderLock {
    /// Locks a folder, which exists, for a run: nobody else works in it.
    ///
    /// # Errors
    /// Another process, or another run of this one, holds it; units are being done; the file system has no
    /// locks.
    pub fn take(folder: &Path) -> Result<Self> {
        let (file, path) = open(folder)?;
        held(file.try_lock(), folder, &path)?;
        Ok(Self { _file: file })
    }

    /// Locks a folder for a unit of its plan, or for who coordinates them, beside other units.
    pub fn take_for_units(folder: &Path) -> Result<Self> {
        let (file, path) = open(folder)?;
        held(file.try_lock_shared(), folder, &path)?;
        Ok(Self { _file: file })
    }
}

fn open(folder: &Path) -> Result<(File, PathBuf)> {
    let work = folder.join(WORK_DIR);
    fs::create_dir_all(&work).map_err(Error::io("making a folder", &work))?;
    let path = work.join(LOCK_FILE);
    let file = File::options()
        .create(true)
        .truncate(false)
        .read(true)
        .write(true)
        .open(&path)
        .map_err(Error::io("opening", &path))?;
    Ok((file, path))
}

fn held(outcome: std::result::Result<(), TryLockError>, folder: &Path, path: &Path) -> Result<()> {
    match outcome {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(Error::Busy {
            path: folder.to_path_buf(),
        }),
        Err(TryLockError::Error(cause)) => Err(Error::Io {
            action: "locking the results folder (it must lie where files can be locked, such as a local disk)",
            path: path.to_path_buf(),
            cause,
        }),
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

    #[test]
    fn units_work_side_by_side_and_keep_runs_out() {
        let folder = tempfile::tempdir().unwrap();
        let units = [0, 1].map(|_| FolderLock::take_for_units(folder.path()).unwrap());
        assert!(FolderLock::take(folder.path()).is_err());
        drop(units);
        let run = FolderLock::take(folder.path()).unwrap();
        assert!(FolderLock::take_for_units(folder.path()).is_err());
        drop(run);
        FolderLock::take_for_units(folder.path()).unwrap();
    }
}
