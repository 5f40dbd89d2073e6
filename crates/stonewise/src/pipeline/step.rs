//! Steps that keep their results and resume.
//!
//! A step owns a folder. `step.json` in it names the key its files were made under: the digest of everything
//! that the result depends on. Another key empties the folder; the same key keeps every finished file, so an
//! interrupted step goes on where it stopped. `done` is written last.

use crate::error::{Error, Result};
use crate::files::write_text;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Digest of everything that a step's result depends on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key(String);

impl Key {
    /// The key of a step from its name, its parameters and the keys and digests of its inputs.
    pub fn new(step: &str, parameters: &impl Serialize, inputs: &[&str]) -> Self {
        let mut hasher = blake3::Hasher::new();
        let parameters = serde_json::to_string(parameters).unwrap_or_default();
        let code = code_version();
        for part in [step, code.as_str(), parameters.as_str()].iter().chain(inputs) {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part.as_bytes());
        }
        Self(hasher.finalize().to_hex().to_string())
    }

    /// The key as text, to be an input of another.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// How many versions of a step's files are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeps {
    /// One: a step that is done under another key replaces its files. For a project that is run again and again.
    Newest,
    /// One for each key. For experiments, whose variants share what they have in common.
    Every,
}

/// The folder that holds the folders of all steps.
pub struct StepStore {
    folder: PathBuf,
    keeps: Keeps,
    /// One for each folder in which somebody works.
    turns: Mutex<BTreeMap<PathBuf, Arc<Mutex<()>>>>,
    digests: Mutex<BTreeMap<PathBuf, String>>,
}

impl StepStore {
    /// A store in a folder, which is made if need be.
    pub fn new(folder: &Path, keeps: Keeps) -> Result<Self> {
        fs::create_dir_all(folder).map_err(Error::io("making the result folder", folder))?;
        Ok(Self {
            folder: folder.to_path_buf(),
            keeps,
            turns: Mutex::default(),
            digests: Mutex::default(),
        })
    }

    /// The folder itself.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Does a step with `make`, unless its files are there under this key; the second value tells whether they were.
    ///
    /// Of several threads that want the same step one does it and the others wait: call it from threads that no
    /// thread pool lends out, or they may wait for themselves.
    pub fn step(
        &self,
        name: &str,
        key: Key,
        make: impl FnOnce(&StepDir) -> Result<()>,
    ) -> Result<(StepDir, bool)> {
        let path = match self.keeps {
            Keeps::Newest => self.folder.join(name),
            Keeps::Every => self.folder.join(name).join(&key.as_str()[..VERSION_DIGITS]),
        };
        let turn = {
            let mut turns = self.turns.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(turns.entry(path.clone()).or_default())
        };
        let _mine = turn.lock().unwrap_or_else(PoisonError::into_inner);
        let dir = StepDir::open(path, key)?;
        let found = dir.is_done();
        if !found {
            make(&dir)?;
            dir.finish()?;
        }
        Ok((dir, found))
    }

    /// Digest of an input file or folder, read once.
    pub fn digest(&self, path: &Path) -> Result<String> {
        let mut known = self.digests.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(digest) = known.get(path) {
            return Ok(digest.clone());
        }
        let digest = path_digest(path)?;
        known.insert(path.to_path_buf(), digest.clone());
        Ok(digest)
    }
}

/// Digits of a key that name one version of a step's files.
const VERSION_DIGITS: usize = 16;

/// The folder of one step.
#[derive(Clone, Debug)]
pub struct StepDir {
    path: PathBuf,
    key: Key,
}

impl StepDir {
    /// Opens the folder of a step, emptied first if it was made under another key.
    pub fn open(path: PathBuf, key: Key) -> Result<Self> {
        let stamp = path.join("step.json");
        if fs::read_to_string(&stamp).ok().as_deref() != Some(key.as_str()) {
            if path.exists() {
                fs::remove_dir_all(&path).map_err(Error::io("emptying a stale step", &path))?;
            }
            fs::create_dir_all(&path).map_err(Error::io("making a folder", &path))?;
            write_text(&stamp, key.as_str())?;
        }
        Ok(Self { path, key })
    }

    /// What the step's result depends on.
    pub fn key(&self) -> &Key {
        &self.key
    }

    /// Whether all of the step's files are there.
    fn is_done(&self) -> bool {
        self.path.join("done").exists()
    }

    /// Says that all of the step's files are there.
    fn finish(&self) -> Result<()> {
        write_text(&self.path.join("done"), "")
    }

    /// Where a file of the step lies.
    pub fn file(&self, name: impl AsRef<Path>) -> PathBuf {
        self.path.join(name)
    }

    /// The folder itself.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Digest of a file's content.
fn file_digest(path: &Path) -> Result<String> {
    let mut hasher = blake3::Hasher::new();
    let file = fs::File::open(path).map_err(Error::io("opening", path))?;
    hasher.update_reader(file).map_err(Error::io("reading", path))?;
    Ok(hasher.finalize().to_hex().to_string())
}

/// Digest of a file, or of all files of a folder and below with their names.
pub fn path_digest(path: &Path) -> Result<String> {
    if !path.is_dir() {
        return file_digest(path);
    }
    let mut entries = fs::read_dir(path)
        .and_then(|entries| {
            entries
                .map(|e| e.map(|e| e.path()))
                .collect::<std::io::Result<Vec<_>>>()
        })
        .map_err(Error::io("listing", path))?;
    entries.sort();
    let mut hasher = blake3::Hasher::new();
    for entry in entries {
        hasher.update(entry.file_name().unwrap_or_default().as_encoded_bytes());
        hasher.update(path_digest(&entry)?.as_bytes());
    }
    Ok(hasher.finalize().to_hex().to_string())
}

/// Identifies the code that made a result: another build never reuses this one's files.
fn code_version() -> String {
    static VERSION: std::sync::OnceLock<String> = std::sync::OnceLock::new();
    VERSION
        .get_or_init(|| {
            let digest = std::env::current_exe()
                .ok()
                .and_then(|exe| file_digest(&exe).ok());
            digest.unwrap_or_else(|| env!("CARGO_PKG_VERSION").to_owned())
        })
        .clone()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn the_same_key_keeps_finished_files_and_another_key_empties_the_folder() {
        let work = tempfile::tempdir().unwrap();
        let open = |key| StepDir::open(work.path().join("a"), Key::new("a", &key, &[])).unwrap();
        let step = open(1);
        fs::write(step.file("unit"), "x").unwrap();
        let again = open(1);
        assert!(again.file("unit").exists() && !again.is_done());
        again.finish().unwrap();
        assert!(step.is_done());
        let other = open(2);
        assert!(!other.file("unit").exists() && !other.is_done());
    }

    #[test]
    fn a_store_of_every_version_does_each_key_once_from_any_number_of_threads() {
        let work = tempfile::tempdir().unwrap();
        let store = StepStore::new(work.path(), Keeps::Every).unwrap();
        let made = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for i in 0..8 {
                let (store, made) = (&store, &made);
                scope.spawn(move || {
                    let key = Key::new("a", &(i % 2), &[]);
                    let make = |dir: &StepDir| {
                        made.fetch_add(1, Ordering::SeqCst);
                        write_text(&dir.file("unit"), "x")
                    };
                    let (dir, _) = store.step("a", key, make).unwrap();
                    assert!(dir.file("unit").exists());
                });
            }
        });
        assert_eq!(made.into_inner(), 2);
        let newest = StepStore::new(work.path(), Keeps::Newest).unwrap();
        let other = newest.step("b", Key::new("b", &0, &[]), |_| Ok(())).unwrap();
        assert_eq!(
            (other.0.path(), other.1),
            (work.path().join("b").as_path(), false)
        );
    }

    #[test]
    fn a_key_depends_on_every_part_and_on_where_parts_end() {
        let key = |step: &str, inputs: &[&str]| Key::new(step, &0, inputs);
        assert_ne!(key("a", &["bc", "d"]), key("a", &["b", "cd"]));
        assert_ne!(key("a", &["b"]), key("c", &["b"]));
        assert_eq!(key("a", &["b"]), key("a", &["b"]));
    }

    #[test]
    fn a_folder_digest_sees_names_and_contents() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("a"), "1").unwrap();
        let first = path_digest(dir.path()).unwrap();
        fs::rename(dir.path().join("a"), dir.path().join("b")).unwrap();
        let renamed = path_digest(dir.path()).unwrap();
        fs::write(dir.path().join("b"), "2").unwrap();
        assert!(first != renamed && renamed != path_digest(dir.path()).unwrap());
    }
}
