//! Temporary files and folders that a killed run left behind.

use std::fs;
use std::path::Path;

/// Removes temporary files and folders below a folder, `.NAME.DIGITS.partial`. Only for the holder of the
/// folder's lock: nobody else writes there. What cannot be removed or listed stays; it does no harm.
///
/// `is_ours`: whether to look into a folder, by its path below `folder`.
pub(super) fn sweep(folder: &Path, is_ours: &dyn Fn(&Path) -> bool) {
    let mut open = vec![folder.to_path_buf()];
    while let Some(dir) = open.pop() {
        let Ok(entries) = fs::read_dir(&dir) else { continue };
        for entry in entries.flatten() {
            let path = entry.path();
            // Links are not followed: what lies behind them is somebody else's.
            let is_dir = entry.file_type().is_ok_and(|t| t.is_dir());
            let below = path.strip_prefix(folder).unwrap_or(&path);
            let is_partial = is_partial(&entry.file_name().to_string_lossy());
            match (is_dir, is_partial) {
                // The folder of a step whose work was not finished, in the folder of all steps.
                (true, true) if below.parent().is_some_and(|p| p != Path::new("")) && is_ours(below) => {
                    let _ = fs::remove_dir_all(&path);
                }
                (true, _) if is_ours(below) => open.push(path),
                (false, true) => {
                    let _ = fs::remove_file(&path);
                }
                _ => {}
            }
        }
    }
}

/// Whether a name is one that [`stonewise_io::atomic::partial_name`] gives.
pub(super) fn is_partial(name: &str) -> bool {
    let stem = name.strip_prefix('.').and_then(|n| n.strip_suffix(".partial"));
    stem.and_then(|s| s.rsplit_once('.')).is_some_and(|(file, pid)| {
        !file.is_empty() && !pid.is_empty() && pid.bytes().all(|b| b.is_ascii_digit())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_temporary_files_go_and_only_where_the_folder_is_ours() {
        let dir = tempfile::tempdir().unwrap();
        let files = [
            ("work/a/.tile.parquet.77.partial", false),
            ("work/.label-1.1234.partial/0_0_0.parquet", false),
            (".mine.12.partial/notes", true),
            (".stones.csv.1.partial", false),
            ("survey/.mine.2.partial", true),
            ("notes.partial", true),
            (".x.partial", true),
            (".a.b1.partial", true),
        ];
        for (file, _) in files {
            let path = dir.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "x").unwrap();
        }
        sweep(dir.path(), &|below| below.starts_with("work"));
        for (file, stays) in files {
            assert_eq!(dir.path().join(file).exists(), stays, "{file}");
        }
    }

    #[test]
    fn the_names_that_atomic_writing_gives_are_recognised() {
        let dir = tempfile::tempdir().unwrap();
        let _ = stonewise_io::atomic::write_atomically(&dir.path().join("a.laz"), |partial| {
            assert!(is_partial(&partial.file_name().unwrap().to_string_lossy()));
            fs::write(partial, "x")
        });
    }
}
