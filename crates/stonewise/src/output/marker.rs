//! Whose results a folder holds.

use super::lock::LOCK_FILE;
use super::partials::is_partial;
use crate::error::{Error, Result};
use crate::files::{relative, resolved, write_readable_json};
use crate::project::Project;
use crate::results::names::WORK_DIR;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Name of the marker, in the folder that stonewise keeps for itself.
const MARKER_FILE: &str = "marker.json";

/// What a folder's contents are made from. Two commands may write into one folder if their owners are the
/// same.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Owner {
    /// `project`, `survey`, `clouds`, ...
    kind: String,
    /// What distinguishes it from others of its kind: paths, or a digest of parameters.
    identity: String,
    /// The owner in words.
    what: String,
}

impl Owner {
    /// Results of a project file; every step of it may go into one folder.
    pub fn project(path: &Path, name: &str) -> Self {
        let path = resolved(path);
        Self {
            kind: "project".to_owned(),
            what: format!("project {name:?}, {}", path.display()),
            identity: path.to_string_lossy().into_owned(),
        }
    }

    /// A simulated survey; another seed, or another size, is another survey.
    pub fn survey(seed: u64, parameters: &str) -> Self {
        Self {
            kind: "survey".to_owned(),
            identity: blake3::hash(parameters.as_bytes()).to_hex().to_string(),
            what: format!("the simulated survey of seed {seed}"),
        }
    }

    /// Results of a command on these inputs.
    pub fn inputs(kind: &str, inputs: &[PathBuf]) -> Self {
        let all: Vec<String> = inputs
            .iter()
            .map(|p| resolved(p).to_string_lossy().into_owned())
            .collect();
        Self {
            kind: kind.to_owned(),
            identity: all.join("\n"),
            what: match all.as_slice() {
                [] => kind.to_owned(),
                all => format!("{kind} of {}", all.join(", ")),
            },
        }
    }
}

/// The marker as it is written.
#[derive(Serialize, Deserialize)]
struct Marker {
    stonewise: String,
    owner: Owner,
    /// From the folder to the project file, so that both can be moved together.
    relative: Option<PathBuf>,
}

/// To whom a folder belongs.
pub(super) enum Found {
    /// Nothing is in it, or it does not exist.
    Empty,
    /// The folder belongs to the same owner.
    Ours,
    /// The folder belongs to another owner; which, where that is known.
    Other(Option<String>),
}

/// Looks into a folder without touching it.
pub(super) fn look(folder: &Path, owner: &Owner) -> Result<Found> {
    let path = folder.join(WORK_DIR).join(MARKER_FILE);
    match fs::read_to_string(&path) {
        Ok(text) => {
            let marker: Option<Marker> = serde_json::from_str(&text).ok();
            return Ok(match marker {
                Some(marker) if is_same(folder, &marker, owner) => Found::Ours,
                Some(marker) => Found::Other(Some(marker.owner.what)),
                None => Found::Other(None),
            });
        }
        // Below a file there is no folder; making one says so.
        Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {}
        Err(e) => return Err(Error::io("reading", &path)(e)),
    }
    if is_empty(folder)? {
        return Ok(Found::Empty);
    }
    Ok(match recorded_for(folder, owner) {
        true => Found::Ours,
        false => Found::Other(None),
    })
}

/// Writes the marker; the folder's lock is held.
pub(super) fn write(folder: &Path, owner: &Owner) -> Result<()> {
    let marker = Marker {
        stonewise: env!("CARGO_PKG_VERSION").to_owned(),
        owner: owner.clone(),
        relative: way(folder, owner),
    };
    write_readable_json(&folder.join(WORK_DIR).join(MARKER_FILE), &marker)
}

fn is_same(folder: &Path, marker: &Marker, owner: &Owner) -> bool {
    let moved_together = || {
        owner.kind == marker.owner.kind
            && marker.relative.is_some()
            && marker.relative == way(folder, owner)
            && !Path::new(&marker.owner.identity).exists()
    };
    (owner.kind == marker.owner.kind && owner.identity == marker.owner.identity) || moved_together()
}

/// The way from the folder to its project file.
fn way(folder: &Path, owner: &Owner) -> Option<PathBuf> {
    relative(folder, Path::new(&owner.identity)).filter(|_| owner.kind == "project")
}

/// Whether nothing is in a folder but what a killed claim left.
fn is_empty(folder: &Path) -> Result<bool> {
    let names = |dir: &Path| -> Result<Vec<String>> {
        match fs::read_dir(dir) {
            Ok(entries) => Ok(entries
                .flatten()
                .map(|e| e.file_name().to_string_lossy().into_owned())
                .collect()),
            Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => Ok(Vec::new()),
            Err(e) => Err(Error::io("listing the output folder", dir)(e)),
        }
    };
    let begun = |name: &String| name == LOCK_FILE || is_partial(name);
    Ok(match names(folder)?.as_slice() {
        [] => true,
        [only] if only == WORK_DIR => names(&folder.join(WORK_DIR))?.iter().all(begun),
        _ => false,
    })
}

/// Whether a folder whose `work/`, and the marker with it, was deleted holds results of this owner: `run.json`
/// names the same project.
fn recorded_for(folder: &Path, owner: &Owner) -> bool {
    if owner.kind != "project" {
        return false;
    }
    let text = fs::read_to_string(folder.join("run.json")).unwrap_or_default();
    let run: Value = serde_json::from_str(&text).unwrap_or_default();
    let Some(file) = run["project"]["file"].as_str().map(|file| folder.join(file)) else {
        return false;
    };
    // It may lead nowhere, because the folder was moved.
    let project = Path::new(&owner.identity);
    resolved(&file) == project
        || (!file.exists()
            && file.file_name() == project.file_name()
            && Project::name_in(project).as_deref() == run["project"]["name"].as_str())
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_simulate::SurveyParams;

    fn ours(folder: &Path, owner: &Owner) -> bool {
        matches!(look(folder, owner).unwrap(), Found::Ours)
    }

    #[test]
    fn a_marked_folder_belongs_to_its_project_even_if_both_are_moved() {
        let dir = tempfile::tempdir().unwrap();
        let (a, b) = (dir.path().join("a"), dir.path().join("b"));
        fs::create_dir_all(a.join("results/work")).unwrap();
        fs::write(a.join("stonewise.toml"), "x").unwrap();
        let owner = Owner::project(&a.join("stonewise.toml"), "dam");
        write(&a.join("results"), &owner).unwrap();
        assert!(ours(&a.join("results"), &owner));
        let other = Owner::project(&a.join("other.toml"), "dam");
        assert!(!ours(&a.join("results"), &other));
        fs::rename(&a, &b).unwrap();
        let moved = Owner::project(&b.join("stonewise.toml"), "dam");
        assert!(ours(&b.join("results"), &moved));
        assert!(!ours(
            &b.join("results"),
            &Owner::project(&b.join("other.toml"), "dam")
        ));
    }

    #[test]
    fn seeds_and_sizes_are_told_apart() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir_all(dir.path().join(WORK_DIR)).unwrap();
        let owner = |params: &SurveyParams| {
            let text = toml::to_string(params).unwrap();
            Owner::survey(params.scene.seed, &text)
        };
        let survey = SurveyParams::demo();
        write(dir.path(), &owner(&survey)).unwrap();
        assert!(ours(dir.path(), &owner(&SurveyParams::demo())));
        // The seed of motions and measurements alone, then the size alone.
        let mut other = survey.clone();
        other.scene.seed += 1;
        assert!(!ours(dir.path(), &owner(&other)));
        let mut other = survey;
        other.scene.wall.width_m += 1.0;
        assert!(!ours(dir.path(), &owner(&other)));
    }

    #[test]
    fn results_without_their_marker_are_recognised() {
        let dir = tempfile::tempdir().unwrap();
        let project = dir.path().join("stonewise.toml");
        fs::write(&project, "[project]\nname = \"dam\"\n").unwrap();
        let results = dir.path().join("results");
        fs::create_dir(&results).unwrap();
        let owner = Owner::project(&project, "dam");
        assert!(matches!(look(&results, &owner).unwrap(), Found::Empty));
        for (file, name, expected) in [
            (project.to_string_lossy().into_owned(), "dam", true),
            ("gone/stonewise.toml".to_owned(), "dam", true),
            ("gone/stonewise.toml".to_owned(), "another dam", false),
            ("gone/other.toml".to_owned(), "dam", false),
        ] {
            let run = serde_json::json!({ "project": { "name": name, "file": file } });
            fs::write(results.join("run.json"), run.to_string()).unwrap();
            assert_eq!(ours(&results, &owner), expected, "{file} {name}");
        }
    }

    #[test]
    fn a_claim_that_was_killed_leaves_an_empty_folder() {
        let dir = tempfile::tempdir().unwrap();
        let owner = Owner::inputs("segment", &[]);
        let work = dir.path().join(WORK_DIR);
        fs::create_dir(&work).unwrap();
        fs::write(work.join(LOCK_FILE), "").unwrap();
        fs::write(work.join(".marker.json.12.partial"), "{").unwrap();
        assert!(matches!(look(dir.path(), &owner).unwrap(), Found::Empty));
        fs::write(work.join("notes"), "mine").unwrap();
        assert!(matches!(look(dir.path(), &owner).unwrap(), Found::Other(None)));
    }
}
