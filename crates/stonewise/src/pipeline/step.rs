//! Steps that keep their results and resume.
//!
//! A step owns a folder. `step.json` in it names the key its files were made under: the digest of everything
//! that the result depends on. Another key empties the folder; the same key keeps every finished file, so an
//! interrupted step goes on where it stopped. `done` is written last.

use crate::error::{Error, Result};
use crate::files::write_text;
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};

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

/// The folder of one step.
#[derive(Clone, Debug)]
pub struct StepDir {
    path: PathBuf,
    key: Key,
}

impl StepDir {
    /// Opens the folder of a step, emptied first if it was made under another key.
    pub fn open(work: &Path, name: &str, key: Key) -> Result<Self> {
        let path = work.join(name);
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
    pub fn is_done(&self) -> bool {
        self.path.join("done").exists()
    }

    /// Says that all of the step's files are there.
    pub fn finish(&self) -> Result<()> {
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

    #[test]
    fn the_same_key_keeps_finished_files_and_another_key_empties_the_folder() {
        let work = tempfile::tempdir().unwrap();
        let step = StepDir::open(work.path(), "a", Key::new("a", &1, &[])).unwrap();
        fs::write(step.file("unit"), "x").unwrap();
        let again = StepDir::open(work.path(), "a", Key::new("a", &1, &[])).unwrap();
        assert!(again.file("unit").exists() && !again.is_done());
        again.finish().unwrap();
        assert!(step.is_done());
        let other = StepDir::open(work.path(), "a", Key::new("a", &2, &[])).unwrap();
        assert!(!other.file("unit").exists() && !other.is_done());
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
