//! Files that appear whole or not at all.

use std::ffi::OsString;
use std::fs::{self, File};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io;
use std::path::{Path, PathBuf};

/// Writes a file under a temporary name beside `path` and renames it when it is complete; makes its folder where
/// there is none.
///
/// `write` gets the temporary name. Whatever stops it (an error, a full disk, a panic) removes the temporary
/// file and leaves an earlier file at `path` as it was. The content reaches the disk before the rename, so a
/// power cut does not leave an empty file either.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("notes.txt");
/// stonewise_io::atomic::write_atomically(&path, |partial| std::fs::write(partial, "done"))?;
/// assert_eq!(std::fs::read_to_string(&path)?, "done");
/// # Ok::<(), std::io::Error>(())
/// ```
///
/// # Errors
/// What `write` returns, or the failure to make the folder, to sync or to rename; naming the file is left to the caller.
pub fn write_atomically<T, E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&Path) -> Result<T, E>,
) -> Result<T, E> {
    let partial = Partial {
        path: partial_name(path)?,
    };
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let value = write(&partial.path)?;
    publish(&partial.path, path)?;
    Ok(value)
}

/// Removes the temporary file unless it was renamed before.
struct Partial {
    path: PathBuf,
}

impl Drop for Partial {
    fn drop(&mut self) {
        // Nothing can be done about a failure here, and after a rename there is nothing to remove.
        let _ = fs::remove_file(&self.path);
    }
}

/// A name beside `path` for what is not finished yet, `.NAME.DIGITS.partial`; another one at every call of
/// any process on any machine.
///
/// # Errors
/// `path` ends in no name.
pub fn partial_name(path: &Path) -> io::Result<PathBuf> {
    let Some(name) = path.file_name() else {
        let message = format!("not the name of a file: {}", path.display());
        return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    };
    let mut partial = OsString::from(".");
    partial.push(name);
    // Process ids of two machines that share a folder can be the same; the keys of a hasher are random.
    let digits = RandomState::new().build_hasher().finish();
    partial.push(format!(".{digits}.partial"));
    Ok(path.with_file_name(partial))
}

fn publish(partial: &Path, path: &Path) -> io::Result<()> {
    File::options().write(true).open(partial)?.sync_all()?;
    fs::rename(partial, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<OsString> {
        fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name())
            .collect()
    }

    #[test]
    fn an_error_keeps_the_earlier_file_and_leaves_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "earlier").unwrap();
        let failed = write_atomically(&path, |partial| {
            fs::write(partial, "half")?;
            Err::<(), _>(io::Error::other("disk full"))
        });
        assert_eq!(failed.unwrap_err().to_string(), "disk full");
        assert_eq!(fs::read_to_string(&path).unwrap(), "earlier");
        assert_eq!(names(folder.path()), ["a.txt"]);
    }

    #[test]
    fn a_finished_file_replaces_the_earlier_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "earlier").unwrap();
        write_atomically(&path, |partial| fs::write(partial, "later")).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "later");
        assert_eq!(names(folder.path()), ["a.txt"]);
    }

    #[test]
    fn a_missing_folder_is_made_and_one_that_cannot_be_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/a.txt");
        write_atomically(&path, |partial| fs::write(partial, "x")).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "x");
        assert!(write_atomically(&path.join("b.txt"), |partial| fs::write(partial, "x")).is_err());
    }
}
