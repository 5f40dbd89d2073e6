//! Results of an earlier run while another one works, and after it failed.
//!
//! A run that begins moves the results of the last one into `previous/`; a run that finishes removes them.
//! What lies under its final name is so always the current run's, and `UNFINISHED.txt` says where that is not
//! finished.

use super::result_names::{PREVIOUS_DIR, cloud_names, is_result};
use crate::error::{Error, Result};
use crate::files::write_text;
use crate::project::Project;
use crate::results::names::{EVIDENCE_DIR, REPORT_DIR};
use std::fs;
use std::path::{Path, PathBuf};

/// Says that the results beside it are not finished.
pub const UNFINISHED_FILE: &str = "UNFINISHED.txt";

/// Marks the results in a folder as unfinished and moves those of an earlier run aside. The folder's lock is
/// held.
///
/// After a run that did not finish, `previous` keeps what it holds: the last finished run's.
pub(super) fn set_aside(folder: &Path, project: &Project) -> Result<()> {
    let (marker, previous) = (folder.join(UNFINISHED_FILE), folder.join(PREVIOUS_DIR));
    let results = results_in(folder, project);
    let was_finished = !marker.exists();
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
    for file in results {
        let (from, to) = (folder.join(&file), previous.join(&file));
        if previous.exists() && !to.exists() {
            move_file(&from, &to)?;
        } else if is_result(&file) {
            fs::remove_file(&from).map_err(Error::io("removing an unfinished result", &from))?;
        }
    }
    Ok(())
}

/// Brings labelled clouds of the last run back, where it wrote them: the step that made them compares their
/// digests.
pub(super) fn bring_back(folder: &Path, file: &Path) -> Result<()> {
    let (from, to) = (folder.join(PREVIOUS_DIR).join(file), folder.join(file));
    if from.exists() && !to.exists() {
        move_file(&from, &to)?;
    }
    Ok(())
}

/// Says that the results are finished. With `all`, none of an earlier run is needed any more.
pub(super) fn finish(folder: &Path, all: bool) -> Result<()> {
    let marker = folder.join(UNFINISHED_FILE);
    if all {
        remove_previous(folder)?;
    }
    fs::remove_file(&marker).map_err(Error::io("removing", &marker))
}

fn remove_previous(folder: &Path) -> Result<()> {
    let previous = folder.join(PREVIOUS_DIR);
    match fs::remove_dir_all(&previous) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
            Err(Error::io("removing the results of an earlier run", &previous)(e))
        }
        _ => Ok(()),
    }
}

fn move_file(from: &Path, to: &Path) -> Result<()> {
    let parent = to.parent().unwrap_or(to);
    fs::create_dir_all(parent).map_err(Error::io("making a folder", parent))?;
    fs::rename(from, to).map_err(Error::io("moving a result of an earlier run aside", from))
}

/// Result files in a folder, relative to it. Files that others put there are none.
pub(super) fn results_in(folder: &Path, project: &Project) -> Vec<PathBuf> {
    let clouds = project.epochs.iter().zip(1..);
    let clouds = clouds.flat_map(|(epoch, number)| cloud_names(number, &epoch.clouds));
    let mut results: Vec<PathBuf> = clouds.filter(|c| folder.join(c).is_file()).collect();
    results.extend(named_results_in(folder));
    results.sort();
    results
}

/// The same without the labelled clouds, whose names only the project tells.
pub(crate) fn named_results_in(folder: &Path) -> Vec<PathBuf> {
    let mut results = Vec::new();
    for below in ["", EVIDENCE_DIR, REPORT_DIR] {
        let Ok(entries) = fs::read_dir(folder.join(below)) else {
            continue;
        };
        let files = entries.flatten().filter(|e| e.path().is_file());
        let names = files.map(|e| Path::new(below).join(e.file_name()));
        results.extend(names.filter(|n| is_result(n)));
    }
    results.sort();
    results
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
            "report/index.html",
            "epoch1/wall.laz",
            "notes.txt",
            "report/notes.txt",
        ] {
            write(out, name, "first");
        }
        set_aside(out, &project).unwrap();
        assert_eq!(read(out, "stones.csv"), None);
        assert_eq!(read(out, "previous/report/index.html").unwrap(), "first");
        assert_eq!(
            read(out, "report/notes.txt").unwrap(),
            "first",
            "somebody's own file"
        );
        assert!(read(out, UNFINISHED_FILE).unwrap().contains("has not finished"));

        // The second run writes a table and is killed; the third writes the same and is killed; the fourth
        // finishes.
        for _ in 0..2 {
            write(out, "stones.csv", "half");
            set_aside(out, &project).unwrap();
            assert_eq!(read(out, "stones.csv"), None);
            assert_eq!(read(out, "previous/stones.csv").unwrap(), "first");
        }
        bring_back(out, Path::new("epoch1/wall.laz")).unwrap();
        assert_eq!(read(out, "epoch1/wall.laz").unwrap(), "first");
        write(out, "stones.csv", "second");
        finish(out, true).unwrap();
        assert!(!out.join(PREVIOUS_DIR).exists() && !out.join(UNFINISHED_FILE).exists());
        assert_eq!(read(out, "stones.csv").unwrap(), "second");
        assert_eq!(read(out, "notes.txt").unwrap(), "first");
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
