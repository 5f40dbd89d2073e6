//! What was opened: a folder of surveys, a project, or results.

use std::fs::File;
use std::io;
use std::path::{Component, Path, PathBuf};
use stonewise::UNFINISHED_FILE;
use stonewise::results::names::{RUN, WORK_DIR, is_of_older_layout, stones_in};

/// Name of the project file in the folder of a survey.
const PROJECT_FILE: &str = "stonewise.toml";
/// What a run says of itself in the folder of its steps.
const MARKER_FILE: &str = "marker.json";
/// Name of the results' folder beside a project file.
const RESULTS_DIR: &str = "results";

/// The folders that the studio works in. It serves and changes nothing outside them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The project file, which need not be there yet; absent for results whose project is gone.
    pub project: Option<PathBuf>,
    /// The folder of the results, which need not be there yet.
    pub results: PathBuf,
    /// The results were opened, and their project lies outside their folder: they may be a copy.
    pub is_project_outside: bool,
}

impl Place {
    /// Finds out what a path is.
    ///
    /// # Errors
    /// Nothing is there, or it is neither.
    pub fn of(path: &Path) -> io::Result<Self> {
        let path = path.canonicalize()?;
        if path.is_file() {
            return Ok(Self::of_project(path));
        }
        if is_results(&path) {
            let project = project_of(&path);
            return Ok(Self {
                is_project_outside: project.as_ref().is_some_and(|p| !p.starts_with(&path)),
                project,
                results: path,
            });
        }
        if is_of_older_layout(&path) {
            return Err(io::Error::other(stonewise::Error::OlderResults(path)));
        }
        Ok(Self::of_project(path.join(PROJECT_FILE)))
    }

    fn of_project(project: PathBuf) -> Self {
        let results = project.parent().unwrap_or(Path::new("/")).join(RESULTS_DIR);
        Self {
            project: Some(project),
            results,
            is_project_outside: false,
        }
    }

    /// The folder of the project file.
    pub fn survey(&self) -> Option<&Path> {
        self.project.as_deref()?.parent()
    }

    /// Opens a file for reading by its path in a folder: a plain file that lies there, also once links are followed.
    pub fn open(&self, folder: &Path, path: &str) -> Option<(File, u64)> {
        let file = File::open(confined(folder, path)?).ok()?;
        let facts = file.metadata().ok()?;
        facts.is_file().then_some((file, facts.len()))
    }

    /// Whether a path lies in the survey's folder or the results', once links are followed.
    pub fn holds(&self, path: &Path) -> bool {
        let Ok(path) = path.canonicalize() else {
            return false;
        };
        let folders = self.survey().into_iter().chain([self.results.as_path()]);
        let mut folders = folders.filter_map(|f| f.canonicalize().ok());
        folders.any(|folder| path.starts_with(folder))
    }
}

/// The file of this path in a folder, links followed; `None` where it lies elsewhere or is not there.
fn confined(folder: &Path, path: &str) -> Option<PathBuf> {
    let path = Path::new(path);
    let is_plain = path.components().all(|c| matches!(c, Component::Normal(_)));
    if !is_plain {
        return None;
    }
    let folder = folder.canonicalize().ok()?;
    let file = folder.join(path).canonicalize().ok()?;
    file.starts_with(folder).then_some(file)
}

/// Whether a run wrote into a folder.
fn is_results(folder: &Path) -> bool {
    folder.join(RUN).is_file() && stones_in(folder).is_ok() || is_unfinished(folder)
}

/// Whether a run began in a folder and has not finished.
fn is_unfinished(folder: &Path) -> bool {
    folder.join(UNFINISHED_FILE).is_file() && folder.join(WORK_DIR).is_dir()
}

/// The project that results name, if it is still there.
fn project_of(results: &Path) -> Option<PathBuf> {
    let marker = results.join(WORK_DIR).join(MARKER_FILE);
    let named = named_in(&results.join(RUN), "/project/file")
        .or_else(|| named_in(&marker, "/relative"))
        .or_else(|| named_in(&marker, "/owner/identity"))?;
    let project = results.join(named).canonicalize().ok()?;
    project.is_file().then_some(project)
}

/// The path that a JSON file holds at a place.
fn named_in(file: &Path, place: &str) -> Option<PathBuf> {
    let record: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(file).ok()?).ok()?;
    Some(PathBuf::from(record.pointer(place)?.as_str()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn nothing_outside_a_folder_is_found() {
        let dir = tempfile::tempdir().unwrap();
        let (inside, outside) = (dir.path().join("in"), dir.path().join("in-side"));
        for folder in [&inside, &outside] {
            fs::create_dir(folder).unwrap();
            fs::write(folder.join("a.txt"), "a").unwrap();
        }
        assert!(confined(&inside, "a.txt").is_some());
        let absolute = outside.join("a.txt");
        for path in [
            "../in-side/a.txt",
            "./../in-side/a.txt",
            "x/../../in-side/a.txt",
            "b.txt",
            absolute.to_str().unwrap(),
        ] {
            assert_eq!(confined(&inside, path), None, "{path}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(&absolute, inside.join("link.txt")).unwrap();
            std::os::unix::fs::symlink(&outside, inside.join("folder")).unwrap();
            assert_eq!(confined(&inside, "link.txt"), None);
            assert_eq!(confined(&inside, "folder/a.txt"), None);
        }
    }

    #[test]
    fn folders_projects_and_results_are_told_apart() {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path().canonicalize().unwrap();
        let project = root.join(PROJECT_FILE);
        let expected = Place {
            project: Some(project.clone()),
            results: root.join(RESULTS_DIR),
            is_project_outside: false,
        };
        assert_eq!(Place::of(&root).unwrap(), expected);
        fs::write(&project, "").unwrap();
        assert_eq!(Place::of(&project).unwrap(), expected);
        let results = root.join("out");
        fs::create_dir_all(results.join("data")).unwrap();
        fs::write(results.join("data/stones.parquet"), "").unwrap();
        let record = serde_json::json!({ "project": { "file": "../stonewise.toml" } });
        fs::write(results.join("run.json"), record.to_string()).unwrap();
        let expected = Place {
            project: Some(project.clone()),
            results: results.clone(),
            is_project_outside: true,
        };
        assert_eq!(Place::of(&results).unwrap(), expected);
        // While a run works, results lie aside.
        fs::remove_file(results.join("run.json")).unwrap();
        fs::create_dir(results.join(WORK_DIR)).unwrap();
        fs::write(results.join(UNFINISHED_FILE), "").unwrap();
        let marker =
            serde_json::json!({ "owner": { "kind": "project", "identity": project }, "relative": null });
        fs::write(results.join(WORK_DIR).join(MARKER_FILE), marker.to_string()).unwrap();
        assert_eq!(Place::of(&results).unwrap(), expected);
        let older = root.join("older");
        fs::create_dir(&older).unwrap();
        fs::write(older.join("stones.parquet"), "").unwrap();
        assert!(Place::of(&older).unwrap_err().to_string().contains("run again"));
        // A copy in another place does not reach back to the original.
        let marker = serde_json::json!({ "owner": { "identity": project }, "relative": "../stonewise.toml" });
        fs::write(results.join(WORK_DIR).join(MARKER_FILE), marker.to_string()).unwrap();
        assert_eq!(Place::of(&results).unwrap(), expected);
        let copy = root.join("elsewhere/out");
        fs::create_dir(root.join("elsewhere")).unwrap();
        fs::rename(&results, &copy).unwrap();
        assert_eq!(Place::of(&copy).unwrap().project, None);
    }
}
