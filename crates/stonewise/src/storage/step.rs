//! The folder of a step.
//!
//! `step.json` in it names the key its files were made under: the digest of everything that the result
//! depends on. `done` lists length and digest of every file that the step stands for, and a step whose files
//! differ from it is done again. The work is done in a folder beside it, which takes its place when
//! everything is there.

use crate::error::{Error, Result};
use crate::files::{write_json, write_text};
use crate::kept::{Kept, file_digest, files_of};
use crate::processor_class;
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use stonewise_io::atomic::partial_name;

/// Digest of everything that a step's result depends on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key(String);

impl Key {
    /// The key of a step from its name, its parameters, the program, the class of the processor, and the keys
    /// and digests of its inputs.
    pub fn new(step: &str, parameters: &impl Serialize, inputs: &[&str]) -> Self {
        let mut hasher = blake3::Hasher::new();
        let parameters = serde_json::to_string(parameters).unwrap_or_default();
        let code = code_version();
        let own = [step, code.as_str(), processor_class(), parameters.as_str()];
        for part in own.iter().chain(inputs) {
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

/// What is known of a step's files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// Some are still to be made, or they were made under another key.
    Unfinished,
    /// All are there, as they were left.
    Done,
    /// Something differs from how it was left, for this reason.
    Damaged(String),
}

/// How closely a step's files are looked at before they are taken over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    /// Their lengths: one of many processes looks at what another has just made.
    Lengths,
    /// Their digests; each file is read once.
    Digests,
}

/// The key that a folder was made under.
const STAMP: &str = "step.json";
/// What the step stands for, once all of it is there.
pub(super) const DONE: &str = "done";

impl StepDir {
    /// Opens the folder of a step, emptied first if it was made under another key.
    ///
    /// # Errors
    /// Something lies there that no step made; a file cannot be written or removed.
    pub fn open(path: PathBuf, key: Key) -> Result<Self> {
        let dir = Self { path, key };
        if !dir.is_of_key() {
            dir.empty()?;
        }
        Ok(dir)
    }

    /// The folder of a step as it is, if it is there.
    pub(super) fn at(path: PathBuf, key: Key) -> Self {
        Self { path, key }
    }

    fn is_of_key(&self) -> bool {
        fs::read_to_string(self.file(STAMP)).ok().as_deref() == Some(self.key.as_str())
    }

    /// Does the step's work in a folder beside its own, and puts that in its place when everything is there.
    ///
    /// Where another process has done the same in the meantime, its folder stays. Errors: something lies
    /// there that no step made; the work fails; a file cannot be written or removed.
    pub(super) fn replace(
        &self,
        published: &[PathBuf],
        make: impl FnOnce(&Self) -> Result<()>,
    ) -> Result<()> {
        self.remove()?;
        let path = partial_name(&self.path).map_err(Error::io("making a folder beside", &self.path))?;
        fs::create_dir_all(&path).map_err(Error::io("making a folder", &path))?;
        let begun = Begun(Self::at(path, self.key.clone()));
        write_text(&begun.0.file(STAMP), self.key.as_str())?;
        make(&begun.0)?;
        begun.0.finish(published)?;
        match fs::rename(&begun.0.path, &self.path) {
            Err(error) if self.state(published, Look::Lengths) != State::Done => {
                Err(Error::io("putting a finished step in place", &self.path)(error))
            }
            _ => Ok(()),
        }
    }

    /// Removes the folder, whatever it holds of this step's files.
    fn remove(&self) -> Result<()> {
        if !self.path.exists() {
            return Ok(());
        }
        self.refuse_foreign()?;
        let aside = partial_name(&self.path).map_err(Error::io("removing a stale step", &self.path))?;
        match fs::rename(&self.path, &aside) {
            Ok(()) => fs::remove_dir_all(&aside).map_err(Error::io("removing a stale step", &aside)),
            // Another process was faster.
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
            Err(error) => Err(Error::io("removing a stale step", &self.path)(error)),
        }
    }

    /// Refuses a folder whose files have neither a stamp nor the record of a finished step: another program made it.
    fn refuse_foreign(&self) -> Result<()> {
        if self.file(STAMP).exists() || self.record(DONE).is_some() || files_of(&self.path, &[])?.is_empty() {
            return Ok(());
        }
        Err(Error::Output {
            path: self.path.clone(),
            message: "files that stonewise did not make lie where a step works: move them away".to_owned(),
        })
    }

    /// What the step's result depends on.
    pub fn key(&self) -> &Key {
        &self.key
    }

    /// Removes every file and begins anew. The stamp goes last: a folder without one is refused.
    fn empty(&self) -> Result<()> {
        let stamp = self.file(STAMP);
        if self.path.exists() {
            self.refuse_foreign()?;
            for entry in fs::read_dir(&self.path).map_err(Error::io("listing", &self.path))? {
                let path = entry.map_err(Error::io("listing", &self.path))?.path();
                let removed = match path.is_dir() {
                    true => fs::remove_dir_all(&path),
                    false if path == stamp => Ok(()),
                    false => fs::remove_file(&path),
                };
                removed.map_err(Error::io("emptying a stale step", &path))?;
            }
        }
        fs::create_dir_all(&self.path).map_err(Error::io("making a folder", &self.path))?;
        write_text(&stamp, self.key.as_str())
    }

    /// Compares the step's files with what `done` says of them.
    pub(super) fn state(&self, published: &[PathBuf], look: Look) -> State {
        let stamp = self.file(STAMP);
        if !stamp.exists() && self.file(DONE).exists() {
            return State::Damaged(format!("{} is missing", stamp.display()));
        }
        if !self.is_of_key() || !self.file(DONE).exists() {
            return State::Unfinished;
        }
        let Some(kept) = self.record(DONE) else {
            return State::Damaged(format!("{} is damaged", self.file(DONE).display()));
        };
        let inside = kept.len().checked_sub(published.len());
        let Some((own, outside)) = inside.map(|n| kept.split_at(n)) else {
            return State::Damaged(format!("{} is damaged", self.file(DONE).display()));
        };
        let own = own.iter().map(|k| (k, self.file(&k.file)));
        let outside = outside.iter().zip(published.iter().cloned());
        let differs = |(kept, path): (&Kept, PathBuf)| match look {
            Look::Lengths => kept.differs_in_length(&path),
            Look::Digests => kept.differs(&path),
        };
        match own.chain(outside).find_map(differs) {
            Some(why) => State::Damaged(why),
            None => State::Done,
        }
    }

    /// Says that all of the step's files are there.
    fn finish(&self, published: &[PathBuf]) -> Result<()> {
        let below = |path: &PathBuf| path.strip_prefix(&self.path).unwrap_or(path).to_path_buf();
        let name = |path: &PathBuf| PathBuf::from(path.file_name().unwrap_or_default());
        let mut kept = Vec::new();
        for path in files_of(&self.path, &[STAMP, DONE])? {
            kept.push(Kept::of(&path, below(&path))?);
        }
        for path in published {
            kept.push(Kept::of(path, name(path))?);
        }
        write_json(&self.file(DONE), &kept)
    }

    fn record(&self, name: &str) -> Option<Vec<Kept>> {
        serde_json::from_slice(&fs::read(self.file(name)).ok()?).ok()
    }

    /// Takes a file of another step, which stays there, under a name of its own. Cost: a link, where the file
    /// system has them.
    pub fn take(&self, from: &Self, file: &str, name: &str) -> Result<()> {
        let (from, to) = (from.file(file), self.file(name));
        match fs::hard_link(&from, &to) {
            Ok(()) => Ok(()),
            Err(_) => fs::copy(&from, &to)
                .map(|_| ())
                .map_err(Error::io("copying", &from)),
        }
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

/// Removes the folder of a step, or of its parts, that is not needed any more; it is gone at once or not at all. What
/// no step made stays.
pub(super) fn discard(path: &Path) -> Result<()> {
    let is_parts = path.extension().is_some_and(|e| e == "parts");
    let is_ours = is_parts || path.join(STAMP).exists() || path.join(DONE).exists();
    if !is_ours || !path.is_dir() {
        return Ok(());
    }
    let aside = partial_name(path).map_err(Error::io("removing a stale step", path))?;
    match fs::rename(path, &aside).and_then(|()| fs::remove_dir_all(&aside)) {
        // Another process was faster.
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        outcome => outcome.map_err(Error::io("removing a stale step", path)),
    }
}

/// The folder in which a step works; it goes unless it took the step's place.
struct Begun(StepDir);

impl Drop for Begun {
    fn drop(&mut self) {
        // After the renaming there is nothing; else the next run removes it.
        let _ = fs::remove_dir_all(&self.0.path);
    }
}

/// Digest of a file, or of all files of a folder and below with their names. A link that leads back to a
/// folder above itself is left out.
pub fn path_digest(path: &Path) -> Result<String> {
    digest_below(path, &mut Vec::new())
}

/// `above`: the folders that lead here, without links.
fn digest_below(path: &Path, above: &mut Vec<PathBuf>) -> Result<String> {
    if !path.is_dir() {
        return file_digest(path);
    }
    let here = path.canonicalize().map_err(Error::io("listing", path))?;
    let mut hasher = blake3::Hasher::new();
    if above.contains(&here) {
        return Ok(hasher.finalize().to_hex().to_string());
    }
    let mut entries = fs::read_dir(path)
        .and_then(|entries| {
            entries
                .map(|e| e.map(|e| e.path()))
                .collect::<std::io::Result<Vec<_>>>()
        })
        .map_err(Error::io("listing", path))?;
    entries.sort();
    above.push(here);
    for entry in entries {
        hasher.update(entry.file_name().unwrap_or_default().as_encoded_bytes());
        hasher.update(digest_below(&entry, above)?.as_bytes());
    }
    above.pop();
    Ok(hasher.finalize().to_hex().to_string())
}

/// The file that this code was loaded from, where it is not the program itself.
static LOADED_FROM: OnceLock<PathBuf> = OnceLock::new();

/// Sets the file that this code was loaded from, before any work: a module of Python lies beside its interpreter, whose
/// digest does not identify it.
pub fn set_program(file: PathBuf) {
    // The first call counts; there is only one.
    let _ = LOADED_FROM.set(file);
}

/// Identifies the code that made a result: another build never reuses this one's files.
pub fn code_version() -> String {
    static VERSION: OnceLock<String> = OnceLock::new();
    VERSION
        .get_or_init(|| {
            let program = LOADED_FROM
                .get()
                .cloned()
                .or_else(|| std::env::current_exe().ok());
            let digest = program.and_then(|file| file_digest(&file).ok());
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
        let open = |key| StepDir::open(work.path().join("a"), Key::new("a", &key, &[])).unwrap();
        let step = open(1);
        fs::write(step.file("unit"), "x").unwrap();
        let again = open(1);
        assert!(again.file("unit").exists());
        assert_eq!(again.state(&[], Look::Digests), State::Unfinished);
        again.finish(&[]).unwrap();
        assert_eq!(step.state(&[], Look::Digests), State::Done);
        let other = open(2);
        assert!(!other.file("unit").exists());
        assert_eq!(other.state(&[], Look::Digests), State::Unfinished);
    }

    #[test]
    fn a_finished_step_without_its_stamp_is_damaged_and_done_again() {
        let work = tempfile::tempdir().unwrap();
        let key = Key::new("a", &1, &[]);
        let step = StepDir::open(work.path().join("a"), key.clone()).unwrap();
        fs::write(step.file("unit"), "x").unwrap();
        step.finish(&[]).unwrap();
        fs::remove_file(step.file(STAMP)).unwrap();
        let State::Damaged(why) = step.state(&[], Look::Digests) else {
            panic!("a step without its stamp is taken over");
        };
        assert!(why.contains("step.json is missing"), "{why}");
        let again = |dir: &StepDir| {
            fs::write(dir.file("unit"), "y").unwrap();
            Ok(())
        };
        step.replace(&[], again).unwrap();
        assert_eq!(step.state(&[], Look::Digests), State::Done);
        assert_eq!(fs::read_to_string(step.file("unit")).unwrap(), "y");
    }

    #[test]
    fn files_that_no_step_made_are_not_removed() {
        let work = tempfile::tempdir().unwrap();
        fs::create_dir(work.path().join("a")).unwrap();
        fs::write(work.path().join("a/thesis.tex"), "x").unwrap();
        let refused = StepDir::open(work.path().join("a"), Key::new("a", &1, &[]));
        assert!(refused.unwrap_err().to_string().contains("did not make"));
        assert!(work.path().join("a/thesis.tex").exists());
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
