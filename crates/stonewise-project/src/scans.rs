//! A project from scans alone, one an epoch.

use crate::Project;
use crate::init::quoted;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stonewise_base::error::{Error, Result};
use stonewise_base::files::{relative, write_text};
use stonewise_io::cloud::CloudFormat;

/// Whether a file is a point cloud, and no project.
pub fn is_scan(path: &Path) -> bool {
    path.is_file() && path.extension().is_none_or(|e| e != "toml") && CloudFormat::of(path).is_ok()
}

/// A project of scans and the text of its file, which [`ScansProject::write`] writes.
#[derive(Clone, Debug)]
pub struct ScansProject {
    /// The project.
    pub project: Project,
    text: String,
}

impl ScansProject {
    /// One epoch for each scan, in this order, in a project file `DIR/stonewise.toml`. Where that file is there
    /// already and names the same scans, it is taken as it is.
    ///
    /// # Errors
    /// Fewer than two scans, one of them twice or not there; `dir` holds another project file.
    pub fn new(scans: &[PathBuf], dir: &Path) -> Result<Self> {
        let path = dir.join("stonewise.toml");
        if let [only] = scans {
            return Err(Error::Parameters(format!(
                "a single scan shows no motion; name the scans of two or more epochs, in order of time: {}",
                only.display()
            )));
        }
        let scans: Vec<PathBuf> = scans
            .iter()
            .map(|scan| dunce::canonicalize(scan).map_err(Error::io("finding", scan)))
            .collect::<Result<_>>()?;
        if !path.exists() {
            // The folder, from which the ways lead, may not be there yet.
            return Ok(Self {
                project: Project::parse(&path, &text_of(&scans, |scan| scan.to_path_buf()))?,
                text: text_of(&scans, |scan| {
                    relative(dir, scan).unwrap_or_else(|| scan.to_path_buf())
                }),
            });
        }
        let text = std::fs::read_to_string(&path).map_err(Error::io("reading", &path))?;
        let mut project = Project::parse(&path, &text)?;
        for cloud in project.epochs.iter_mut().flat_map(|epoch| &mut epoch.clouds) {
            *cloud = dunce::canonicalize(&*cloud).map_err(Error::io("finding", cloud))?;
        }
        let named: Vec<&PathBuf> = project.epochs.iter().flat_map(|e| &e.clouds).collect();
        if named != scans.iter().collect::<Vec<_>>() {
            let message =
                "this is the project of other scans: run it itself, or give another --out".to_owned();
            return Err(Error::Input { path, message });
        }
        Ok(Self { project, text })
    }

    /// Writes the project file, into a folder that exists.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self) -> Result<()> {
        write_text(&self.project.path, &self.text)
    }
}

/// The project file; `way`: how it names a scan.
fn text_of(scans: &[PathBuf], way: impl Fn(&Path) -> PathBuf) -> String {
    let names = names(scans);
    let mut text = String::from(
        "# Written by `stonewise run`; your changes are kept. All keys: `stonewise self schema`.\n[project]\n",
    );
    let _ = writeln!(text, "name = {}", quoted(&title(&names)));
    for (name, scan) in names.iter().zip(scans) {
        let scan = quoted(&way(scan).to_string_lossy());
        let _ = writeln!(text, "\n[[epochs]]\nname = {}\nclouds = [{scan}]", quoted(name));
    }
    text
}

/// A title of the project by the names of its epochs: what they begin with in common, up to a separator, and how the
/// first and the last differ (`dam 2024 to 2025`).
fn title(names: &[String]) -> String {
    let [first, .., last] = names else {
        return names.concat();
    };
    let is_common = |end: &usize| names.iter().all(|name| name.starts_with(&first[..*end]));
    let separators = first.char_indices().filter(|(_, c)| "_- .".contains(*c));
    let common = separators.map(|(at, c)| at + c.len_utf8()).rfind(is_common);
    let (shared, first_end) = first.split_at(common.unwrap_or(0));
    let last_end = last.strip_prefix(shared).unwrap_or(last);
    let shared = shared.replace(['_', '-', '.'], " ");
    format!("{shared}{first_end} to {last_end}")
}

/// Names of epochs: those of the files, or of their folders, if these tell them apart, else numbers.
fn names(scans: &[PathBuf]) -> Vec<String> {
    let text = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    let files: Vec<String> = scans.iter().map(|s| text(s.file_stem())).collect();
    let folders: Vec<String> = scans
        .iter()
        .map(|s| text(s.parent().and_then(Path::file_name)))
        .collect();
    let tell_apart = |names: &[String]| {
        let mut sorted = names.to_vec();
        sorted.sort();
        sorted.dedup();
        sorted.len() == names.len() && names.iter().all(|n| !n.trim().is_empty())
    };
    let choices = [files, folders].into_iter();
    let numbers = || (1..=scans.len()).map(|n| format!("epoch {n}")).collect();
    choices
        .into_iter()
        .find(|n| tell_apart(n))
        .unwrap_or_else(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use stonewise_base::thresholds::Quantity;

    fn scans(dir: &Path, names: &[&str]) -> Vec<PathBuf> {
        let write = |name: &&str| {
            let path = dir.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, "0 0 0\n").unwrap();
            path
        };
        names.iter().map(write).collect()
    }

    #[test]
    fn scans_and_results_move_together() {
        let dir = tempfile::tempdir().unwrap();
        let (here, there) = (dir.path().join("here"), dir.path().join("there"));
        let paths = scans(&here, &["a.xyz", "b.xyz"]);
        let made = ScansProject::new(&paths, &here.join("out")).unwrap();
        assert!(made.text.contains("clouds = [\"../a.xyz\"]"), "{}", made.text);
        fs::create_dir(here.join("out")).unwrap();
        made.write().unwrap();
        fs::rename(&here, &there).unwrap();
        let project = Project::read(&there.join("out/stonewise.toml")).unwrap();
        let clouds: Vec<PathBuf> = project
            .epochs
            .iter()
            .map(|e| e.clouds[0].canonicalize().unwrap())
            .collect();
        let moved = ["a.xyz", "b.xyz"].map(|name| there.join(name).canonicalize().unwrap());
        assert_eq!(clouds, moved);
        assert!(ScansProject::new(&moved, &there.join("out")).is_ok());
    }

    #[test]
    fn epochs_are_named_by_what_tells_the_files_apart() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        let epochs = |names: &[&str]| -> Vec<String> {
            let made = ScansProject::new(&scans(dir.path(), names), &out).unwrap();
            made.project.epochs.iter().map(|e| e.name.clone()).collect()
        };
        assert_eq!(epochs(&["b 2025.xyz", "a.xyz"]), ["b 2025", "a"]);
        assert_eq!(epochs(&["2024/x.xyz", "2025/x.xyz"]), ["2024", "2025"]);
        assert_eq!(
            epochs(&["2024/x.xyz", "2024/y.xyz", "2025/x.xyz"]),
            ["epoch 1", "epoch 2", "epoch 3"]
        );
    }

    #[test]
    fn a_file_that_names_other_scans_is_refused_and_edits_stay() {
        let dir = tempfile::tempdir().unwrap();
        let all = scans(dir.path(), &["a.xyz", "b.xyz", "c.xyz"]);
        assert!(ScansProject::new(&all[..1], dir.path()).is_err());
        let made = ScansProject::new(&all[..2], dir.path()).unwrap();
        made.write().unwrap();
        let path = dir.path().join("stonewise.toml");
        let edited = fs::read_to_string(&path).unwrap() + "\n[thresholds]\nalarm_mm = 7.5\n";
        fs::write(&path, edited).unwrap();
        let again = ScansProject::new(&all[..2], dir.path()).unwrap();
        let mut alarms = again.project.settings.thresholds.of(Quantity::Length, None);
        assert_eq!(alarms.next().map(|t| t.limit), Some(7.5));
        assert!(ScansProject::new(&all, dir.path()).is_err());
    }

    #[test]
    fn the_title_says_which_scans_were_compared() {
        let title = |names: &[&str]| title(&names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>());
        assert_eq!(title(&["dam_2024", "dam_2025"]), "dam 2024 to 2025");
        assert_eq!(
            title(&["wall-a_2019", "wall-a_2021", "wall-a_2024"]),
            "wall a 2019 to 2024"
        );
        assert_eq!(title(&["epoch1", "epoch2"]), "epoch1 to epoch2");
        assert_eq!(
            title(&["Mauer_\u{fc}_1", "Mauer_\u{f6}_2"]),
            "Mauer \u{fc}_1 to \u{f6}_2"
        );
    }

    #[test]
    fn project_files_are_no_scans() {
        let dir = tempfile::tempdir().unwrap();
        let scan = &scans(dir.path(), &["a.xyz"])[0];
        let project = dir.path().join("stonewise.toml");
        fs::write(&project, "").unwrap();
        assert!(is_scan(scan) && !is_scan(&project) && !is_scan(dir.path()));
    }
}
