//! Results of an earlier run while another one works, and after it failed.
//!
//! A run that begins moves the results of the last one into `previous/`; a run that finishes removes them.
//! What lies under its final name is so always the current run's, and `UNFINISHED.txt` says where that is not
//! finished.

use super::digests::Digests;
use super::result_names::{PREVIOUS_DIR, cloud_names, is_result, of_older_layout};
use crate::error::{Error, Result};
use crate::files::{is_there, write_text};
use crate::project::Project;
use crate::results::names::{DATA_DIR, DIGESTS, EVIDENCE_DIR, REMARKS, REPORT_DIR};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Says that the results beside it are not finished.
pub const UNFINISHED_FILE: &str = "UNFINISHED.txt";

/// Marks the results in a folder as unfinished and moves those of an earlier run aside. The folder's lock is
/// held.
///
/// After a run that did not finish, `previous` keeps what it holds: the last finished run's.
pub(super) fn set_aside(folder: &Path, project: &Project) -> Result<()> {
    let (marker, previous) = (folder.join(UNFINISHED_FILE), folder.join(PREVIOUS_DIR));
    let mut results = results_in(folder, project)?;
    // Labelled clouds of an epoch that the project no longer has.
    for (listed, _) in Digests::read(folder).ok().flatten().unwrap_or_default().iter() {
        if is_there(&folder.join(listed))? {
            results.push(listed.to_path_buf());
        }
    }
    results.sort();
    results.dedup();
    let was_finished = !is_there(&marker)?;
    if was_finished && !results.is_empty() {
        remove_previous(folder)?;
        fs::create_dir_all(&previous).map_err(Error::io("making a folder", &previous))?;
    }
    let text = format!(
        "A run of {:?} began here and has not finished.\n\
         Results of an earlier run, if there were any, lie in the folder \"{PREVIOUS_DIR}\"; they are NOT those of the\n\
         parameters and inputs of now. What else lies here is incomplete. Run the same command again to go on;\n\
         this file goes when the run has finished.\n",
        project.name
    );
    write_text(&marker, &text)?;
    sync_folder(folder)?;
    // The list of digests is moved last: where it lies aside, all that belongs to it does.
    let digests = [PathBuf::from(DIGESTS), of_older_layout(Path::new(DIGESTS))];
    let is_aside = |list: &PathBuf| previous.join(list).is_file();
    let is_complete = !is_there(&previous)? || digests.iter().any(is_aside);
    let (last, others): (Vec<_>, Vec<_>) = results.into_iter().partition(|file| digests.contains(file));
    for file in others.into_iter().chain(last) {
        let (from, to) = (folder.join(&file), previous.join(&file));
        if !is_complete && !is_there(&to)? {
            move_file(&from, &to)?;
        } else if is_result(&file) {
            fs::remove_file(&from).map_err(Error::io("removing an unfinished result", &from))?;
        }
        // Folders of an older layout do not stay empty beside the new ones; others are not empty.
        if let Some(parent) = file.parent().filter(|parent| *parent != Path::new("")) {
            let _ = fs::remove_dir(folder.join(parent));
        }
    }
    // What people said of results of an older layout.
    let (kept, older) = (
        folder.join(REMARKS),
        folder.join(of_older_layout(Path::new(REMARKS))),
    );
    match is_there(&older)? && !is_there(&kept)? {
        true => move_file(&older, &kept),
        false => Ok(()),
    }
}

/// Brings labelled clouds of the last run back, where it wrote them: the step that made them compares their
/// digests. They stay aside, too, where the file system has links.
pub(super) fn bring_back(folder: &Path, file: &Path) -> Result<()> {
    let (from, to) = (folder.join(PREVIOUS_DIR).join(file), folder.join(file));
    if !is_there(&from)? || is_there(&to)? {
        return Ok(());
    }
    // The folder went when it was emptied.
    make_parent(&to)?;
    fs::hard_link(&from, &to).or_else(|_| move_file(&from, &to))
}

/// Says that the results, these files, are finished, once their names are on the disk. With `all`, none of an
/// earlier run is needed any more; they go last, so that there is always one whole set of results.
pub(super) fn finish(folder: &Path, results: &[PathBuf], all: bool) -> Result<()> {
    let below = results.iter().filter_map(|file| file.parent());
    let folders: BTreeSet<PathBuf> = below.map(|parent| folder.join(parent)).collect();
    folders.iter().try_for_each(|folder| sync_folder(folder))?;
    let marker = folder.join(UNFINISHED_FILE);
    fs::remove_file(&marker).map_err(Error::io("removing", &marker))?;
    sync_folder(folder)?;
    match all {
        true => remove_previous(folder),
        false => Ok(()),
    }
}

/// Waits until the names in a folder are on the disk: files are synced when they are written, their names are
/// not. A file system that cannot do so for a folder is no error.
fn sync_folder(folder: &Path) -> Result<()> {
    if !cfg!(unix) {
        return Ok(());
    }
    let synced = File::open(folder).and_then(|opened| opened.sync_all());
    match synced.map_err(|error| (error.kind(), error)) {
        Err((ErrorKind::InvalidInput | ErrorKind::Unsupported, _)) | Ok(()) => Ok(()),
        Err((_, error)) => Err(Error::io("syncing to the disk", folder)(error)),
    }
}

fn remove_previous(folder: &Path) -> Result<()> {
    let previous = folder.join(PREVIOUS_DIR);
    match fs::remove_dir_all(&previous) {
        Err(e) if e.kind() != ErrorKind::NotFound => {
            Err(Error::io("removing the results of an earlier run", &previous)(e))
        }
        _ => Ok(()),
    }
}

fn move_file(from: &Path, to: &Path) -> Result<()> {
    make_parent(to)?;
    fs::rename(from, to).map_err(Error::io("moving a file of an earlier run", from))
}

fn make_parent(file: &Path) -> Result<()> {
    let parent = file.parent().unwrap_or(file);
    fs::create_dir_all(parent).map_err(Error::io("making a folder", parent))
}

/// Result files in a folder, relative to it. Files that others put there are not among them.
///
/// # Errors
/// The folder cannot be listed.
pub(crate) fn results_in(folder: &Path, project: &Project) -> Result<Vec<PathBuf>> {
    let clouds = project.epochs.iter().zip(1..);
    let clouds = clouds.flat_map(|(epoch, number)| cloud_names(number, &epoch.clouds));
    let mut results = named_results_in(folder)?;
    for cloud in clouds.flat_map(|cloud| [of_older_layout(&cloud), cloud]) {
        if is_there(&folder.join(&cloud))? {
            results.push(cloud);
        }
    }
    results.sort();
    Ok(results)
}

/// Result files in a folder, relative to it, without the labelled clouds, whose names only the project gives.
///
/// # Errors
/// The folder cannot be listed.
pub(crate) fn named_results_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut results = Vec::new();
    let current = ["", DATA_DIR, EVIDENCE_DIR, REPORT_DIR].map(PathBuf::from);
    let older = [EVIDENCE_DIR, REPORT_DIR].map(|below| of_older_layout(Path::new(below)));
    for below in current.into_iter().chain(older) {
        let listed = folder.join(&below);
        let entries = match fs::read_dir(&listed) {
            Err(e) if e.kind() == ErrorKind::NotFound => continue,
            entries => entries.map_err(Error::io("listing", &listed))?,
        };
        for entry in entries {
            let entry = entry.map_err(Error::io("listing", &listed))?;
            let name = below.join(entry.file_name());
            let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
            if !is_folder && is_result(&name) {
                results.push(name);
            }
        }
    }
    results.sort();
    Ok(results)
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::change::M3c2Params;

    fn write(folder: &Path, name: &str, text: &str) {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    fn read(folder: &Path, name: &str) -> Option<String> {
        fs::read_to_string(folder.join(name)).ok()
    }

    #[test]
    fn results_of_the_last_finished_run_wait_aside_until_the_next_has_finished() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        let project = Project::of_clouds(
            Path::new("a/wall.laz"),
            Path::new("b/wall.laz"),
            M3c2Params::default(),
        );
        for name in [
            "stones.csv",
            "report.html",
            "data/epoch1/wall.laz",
            "data/digests.b3",
            "notes.txt",
            "data/notes.txt",
        ] {
            write(out, name, "first");
        }
        set_aside(out, &project).unwrap();
        assert_eq!(read(out, "stones.csv"), None);
        assert_eq!(read(out, "previous/report.html").unwrap(), "first");
        assert_eq!(
            read(out, "data/notes.txt").unwrap(),
            "first",
            "somebody's own file"
        );
        assert!(read(out, UNFINISHED_FILE).unwrap().contains("has not finished"));

        // The second run writes a table and is killed; the third writes the same and is killed; the fourth
        // finishes.
        for _ in 0..2 {
            write(out, "stones.csv", "half");
            // Of an epoch that the first run did not have.
            write(out, "data/stones_2.csv", "half");
            set_aside(out, &project).unwrap();
            assert_eq!(read(out, "stones.csv"), None);
            assert_eq!(read(out, "data/stones_2.csv"), None);
            assert_eq!(read(out, "previous/stones.csv").unwrap(), "first");
            assert_eq!(read(out, "previous/data/stones_2.csv"), None);
        }
        bring_back(out, Path::new("data/epoch1/wall.laz")).unwrap();
        for place in ["data/epoch1/wall.laz", "previous/data/epoch1/wall.laz"] {
            assert_eq!(read(out, place).unwrap(), "first");
        }
        write(out, "stones.csv", "second");
        finish(out, &["stones.csv".into()], true).unwrap();
        assert!(!out.join(PREVIOUS_DIR).exists() && !out.join(UNFINISHED_FILE).exists());
        assert_eq!(read(out, "stones.csv").unwrap(), "second");
        assert_eq!(read(out, "notes.txt").unwrap(), "first");
    }

    #[test]
    fn nothing_of_an_older_layout_stays_beside_new_results() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        let project = Project::of_clouds(Path::new("a/x.laz"), Path::new("b/x.laz"), M3c2Params::default());
        let older = [
            "stones.parquet",
            "report/index.html",
            "evidence/cloud_2.parquet",
            "epoch1/x.laz",
            "digests.b3",
        ];
        for name in older.iter().chain(&["remarks.json", "notes.txt"]) {
            write(out, name, "first");
        }
        // The second run is killed before it has finished.
        for _ in 0..2 {
            set_aside(out, &project).unwrap();
            write(out, "data/stones.parquet", "half");
        }
        assert_eq!(read(out, "previous/data/stones.parquet"), None);
        for name in older {
            assert_eq!(read(&out.join(PREVIOUS_DIR), name).unwrap(), "first", "{name}");
        }
        finish(out, &["data/stones.parquet".into()], true).unwrap();
        let mut left: Vec<_> = fs::read_dir(out)
            .unwrap()
            .map(|e| e.unwrap().file_name())
            .collect();
        left.sort();
        assert_eq!(left, ["data", "notes.txt"]);
        assert_eq!(read(out, "data/remarks.json").unwrap(), "first");
    }

    #[test]
    fn clouds_of_an_epoch_that_the_project_no_longer_has_go_with_the_run_that_made_them() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        let project = Project::of_clouds(Path::new("a/x.laz"), Path::new("b/x.laz"), M3c2Params::default());
        for name in ["stones.csv", "data/epoch3/x.laz", "data/epoch3/mine.laz"] {
            write(out, name, "first");
        }
        let made = ["stones.csv".into(), "data/epoch3/x.laz".into()];
        Digests::of(out, &made).unwrap().write(out).unwrap();
        set_aside(out, &project).unwrap();
        assert_eq!(read(out, "data/epoch3/x.laz"), None);
        assert_eq!(read(out, "previous/data/epoch3/x.laz").unwrap(), "first");
        finish(out, &["stones.csv".into()], true).unwrap();
        assert_eq!(read(out, "data/epoch3/mine.laz").unwrap(), "first");
    }

    #[test]
    fn a_first_run_that_is_killed_leaves_nothing_for_a_finished_one_to_be_confused_with() {
        let dir = tempfile::tempdir().unwrap();
        let project = Project::of_clouds(Path::new("a/x.laz"), Path::new("b/x.laz"), M3c2Params::default());
        set_aside(dir.path(), &project).unwrap();
        write(dir.path(), "stones.csv", "half");
        set_aside(dir.path(), &project).unwrap();
        assert!(!dir.path().join("stones.csv").exists() && !dir.path().join(PREVIOUS_DIR).exists());
    }
}
