//! The files of a folder, and the kinds of files by their names.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Files in a folder and below that are `wanted`, in no particular order; hidden files and folders are left
/// out.
///
/// Links to folders are followed, but every folder is visited once, so that links that lead back cause no
/// endless way. An error comes with the folder that could not be read.
pub fn files_below(
    folder: &Path,
    wanted: &impl Fn(&Path) -> bool,
) -> Result<Vec<PathBuf>, (PathBuf, io::Error)> {
    let mut visited = BTreeSet::new();
    // Links come last, so that a folder that lies here has the name that it has here.
    let (mut open, mut links) = (vec![folder.to_owned()], Vec::new());
    let mut files = Vec::new();
    while let Some(folder) = open.pop().or_else(|| links.pop()) {
        let failed = |error| (folder.clone(), error);
        if !visited.insert(fs::canonicalize(&folder).map_err(failed)?) {
            continue;
        }
        for path in entries(&folder).map_err(failed)?.into_iter().rev() {
            if !path.is_dir() {
                files.extend(wanted(&path).then_some(path));
            } else if path.is_symlink() {
                links.push(path);
            } else {
                open.push(path);
            }
        }
    }
    Ok(files)
}

fn entries(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let is_hidden = |path: &PathBuf| {
        path.file_name()
            .is_some_and(|name| name.to_string_lossy().starts_with('.'))
    };
    let all = fs::read_dir(folder)?.map(|entry| entry.map(|e| e.path()));
    let mut entries = all.collect::<io::Result<Vec<_>>>()?;
    entries.retain(|path| !is_hidden(path));
    entries.sort();
    Ok(entries)
}

/// What stands behind the last point of a file's name, in small letters; empty where there is none.
pub(crate) fn extension(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_lowercase()
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn links_that_lead_back_are_followed_once() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        fs::create_dir_all(root.join("b/c")).unwrap();
        for name in ["one.jpg", "b/two.jpg", "b/c/three.jpg", "b/.hidden.jpg"] {
            fs::write(root.join(name), "").unwrap();
        }
        // Two links per folder that lead back: without a memory of folders, 2 to the power of the depth of
        // ways.
        for link in [
            "first",
            "second",
            "b/first",
            "b/second",
            "b/c/first",
            "b/c/second",
        ] {
            symlink(root, root.join(link)).unwrap();
        }
        symlink(root.join("b"), root.join("a")).unwrap();
        let mut found = files_below(root, &|path| path.extension().is_some()).unwrap();
        found.sort();
        assert_eq!(
            found,
            ["b/c/three.jpg", "b/two.jpg", "one.jpg"].map(|name| root.join(name))
        );
    }

    #[test]
    fn a_folder_that_is_linked_from_elsewhere_is_read() {
        let (photos, survey) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        fs::write(photos.path().join("one.jpg"), "").unwrap();
        symlink(photos.path(), survey.path().join("flight")).unwrap();
        let found = files_below(survey.path(), &|_| true).unwrap();
        assert_eq!(found, [survey.path().join("flight/one.jpg")]);
    }
}
