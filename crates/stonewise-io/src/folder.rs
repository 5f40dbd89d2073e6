//! The files of a folder.

use std::io;
use std::path::{Path, PathBuf};

/// Files in a folder and below that are `wanted`; hidden files and folders are left out. The order is the system's.
///
/// An error comes with the folder that could not be read.
pub fn files_below(
    folder: &Path,
    wanted: &impl Fn(&Path) -> bool,
) -> Result<Vec<PathBuf>, (PathBuf, io::Error)> {
    let failed = |error| (folder.to_owned(), error);
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let is_hidden = path
            .file_name()
            .is_some_and(|n| n.to_string_lossy().starts_with('.'));
        if is_hidden {
            continue;
        }
        if path.is_dir() {
            files.extend(files_below(&path, wanted)?);
        } else if wanted(&path) {
            files.push(path);
        }
    }
    Ok(files)
}
