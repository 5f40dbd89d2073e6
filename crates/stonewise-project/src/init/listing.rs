//! Files and folders by what their names say.

use std::fs;
use std::path::{Path, PathBuf};
use stonewise_base::error::{Error, Result};

/// Name in lower case.
pub(super) fn name(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase()
}

/// Whether a file has one of these extensions.
pub(super) fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    path.extension()
        .is_some_and(|e| extensions.contains(&e.to_string_lossy().to_lowercase().as_str()))
}

/// Folders in a folder, by name; hidden ones and links are left out.
pub(super) fn folders(dir: &Path) -> Result<Vec<PathBuf>> {
    let is_own = |p: &PathBuf| p.is_dir() && !p.is_symlink();
    Ok(entries(dir)?.into_iter().filter(is_own).collect())
}

/// Files in a folder, by name; hidden ones are left out.
pub(super) fn files(dir: &Path) -> Result<Vec<PathBuf>> {
    Ok(entries(dir)?.into_iter().filter(|p| p.is_file()).collect())
}

/// Whether a command of stonewise wrote a folder: it has a marker, or the files of a run.
pub(super) fn is_made_by_stonewise(dir: &Path) -> bool {
    dir.join("work/marker.json").exists()
        || (dir.join("run.json").exists() && dir.join("stones.csv").exists())
}

fn entries(dir: &Path) -> Result<Vec<PathBuf>> {
    let mut entries = fs::read_dir(dir)
        .and_then(|all| {
            all.map(|e| e.map(|e| e.path()))
                .collect::<std::io::Result<Vec<_>>>()
        })
        .map_err(Error::io("listing", dir))?;
    entries.retain(|p| !name(p).starts_with('.'));
    entries.sort();
    Ok(entries)
}
