//! The folder of a step.
//!
//! It is named after the key its files were made under: the digest of everything that the result depends on.
//! `done` in it lists length and digest of every file that the step stands for, and a step whose files differ
//! from it is done again. The work is done in a folder beside it, which takes its place when everything is
//! there.

use crate::error::{Error, Result};
use crate::files::write_json;
use crate::kept::{Kept, file_digest, files_of};
use crate::processor_class;
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::UNIX_EPOCH;
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

/// Where a step's files come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// They are made now.
    Made,
    /// An earlier run made them, and they are as it left them.
    Found,
    /// An earlier run made them, and they are not as it left them, for this reason: they are made again.
    MadeAgain(String),
}

/// How closely a step's files are looked at before they are taken over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    /// Their lengths: one of many processes looks at what another has just made.
    Lengths,
    /// Their digests; each file is read once.
    Digests,
}

/// What the step stands for.
const DONE: &str = "done";

impl StepDir {
    /// The folder of a step as it is, if it is there.
    pub(super) fn at(path: PathBuf, key: Key) -> Self {
        Self { path, key }
    }

    /// Does the step's work in a folder beside its own, and puts that in its place when everything is there.
    ///
    /// Where another process has done the same in the meantime, its folder stays. Errors: the work fails; a file
    /// cannot be written or removed.
    pub(super) fn replace(
        &self,
        published: &[PathBuf],
        make: impl FnOnce(&Self) -> Result<()>,
    ) -> Result<()> {
        discard(&self.path)?;
        let path = partial_name(&self.path).map_err(Error::io("making a folder beside", &self.path))?;
        fs::create_dir_all(&path).map_err(Error::io("making a folder", &path))?;
        let begun = Begun(Self::at(path, self.key.clone()));
        make(&begun.0)?;
        begun.0.finish(published)?;
        match fs::rename(&begun.0.path, &self.path) {
            Err(error) if self.origin(published, Look::Lengths) != Origin::Found => {
                Err(Error::io("putting a finished step in place", &self.path)(error))
            }
            _ => Ok(()),
        }
    }

    /// What the step's result depends on.
    pub fn key(&self) -> &Key {
        &self.key
    }

    /// Compares the step's files with what `done` says of them.
    pub(super) fn origin(&self, published: &[PathBuf], look: Look) -> Origin {
        if !self.path.exists() {
            return Origin::Made;
        }
        let Some(kept) = self.record() else {
            return Origin::MadeAgain(format!("{} is missing or damaged", self.file(DONE).display()));
        };
        let inside = kept.len().checked_sub(published.len());
        let Some((own, outside)) = inside.map(|n| kept.split_at(n)) else {
            return Origin::MadeAgain(format!("{} is damaged", self.file(DONE).display()));
        };
        let own = own.iter().map(|k| (k, self.file(&k.file)));
        let outside = outside.iter().zip(published.iter().cloned());
        let differs = |(kept, path): (&Kept, PathBuf)| match look {
            Look::Lengths => kept.differs_in_length(&path),
            Look::Digests => kept.differs(&path),
        };
        match own.chain(outside).find_map(differs) {
            Some(why) => Origin::MadeAgain(why),
            None => Origin::Found,
        }
    }

    /// Says that all of the step's files are there.
    fn finish(&self, published: &[PathBuf]) -> Result<()> {
        let below = |path: &PathBuf| path.strip_prefix(&self.path).unwrap_or(path).to_path_buf();
        let name = |path: &PathBuf| PathBuf::from(path.file_name().unwrap_or_default());
        let mut kept = Vec::new();
        for path in files_of(&self.path, &[DONE])? {
            kept.push(Kept::of(&path, below(&path))?);
        }
        for path in published {
            kept.push(Kept::of(path, name(path))?);
        }
        write_json(&self.file(DONE), &kept)
    }

    fn record(&self) -> Option<Vec<Kept>> {
        serde_json::from_slice(&fs::read(self.file(DONE)).ok()?).ok()
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

/// Removes the folder of a step, or of its parts, if there is one; it is gone at once or not at all.
pub(super) fn discard(path: &Path) -> Result<()> {
    if !path.is_dir() {
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

/// Digest of the names and lengths of a file, or of all files of a folder and below, and with `times` of their
/// times of change; their content is not read.
pub fn look_of(path: &Path, times: bool) -> Result<String> {
    let files = match path.is_dir() {
        true => files_of(path, &[])?,
        false => vec![path.to_path_buf()],
    };
    let look = |file: PathBuf| {
        let data = fs::metadata(&file).map_err(Error::io("reading", &file))?;
        let time = data.modified().ok().filter(|_| times);
        // Machines that share a folder may see fractions of a second differently.
        let seconds = time.and_then(|t| Some(t.duration_since(UNIX_EPOCH).ok()?.as_secs()));
        Ok((file, data.len(), seconds))
    };
    let looks = files.into_iter().map(look).collect::<Result<Vec<_>>>()?;
    Ok(Key::new("look", &looks, &[]).as_str().to_owned())
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
