//! Steps that keep their results and resume.
//!
//! A step owns a folder. `step.json` in it names the key its files were made under: the digest of everything
//! that the result depends on. Another key empties the folder; the same key keeps every finished file, so an
//! interrupted step goes on where it stopped. `done` is written last: it lists length and digest of every file that
//! the step stands for, and a step whose files differ from it is done again.

use crate::error::{Error, Result};
use crate::files::{create_results_folder, write_json, write_text};
use crate::kept::{Kept, file_digest, files_of};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

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
    /// Steps whose files this process has compared with their digests or made itself.
    sound: Mutex<BTreeSet<(PathBuf, String)>>,
}

/// Where a step's files come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// They were made now.
    Made,
    /// An earlier run made them, and they are as it left them.
    Found,
    /// An earlier run made them, and they were not as it left them, for this reason: they were made again.
    MadeAgain(String),
}

impl StepStore {
    /// A store in a folder, which is made if need be.
    pub fn new(folder: &Path, keeps: Keeps) -> Result<Self> {
        create_results_folder(folder)?;
        Ok(Self {
            folder: folder.to_path_buf(),
            keeps,
            turns: Mutex::default(),
            digests: Mutex::default(),
            sound: Mutex::default(),
        })
    }

    /// Does a step with `make`, unless its files are there under this key, as they were left.
    ///
    /// `published`: files outside the step's folder that it makes too. Of several threads that start the same step one
    /// does it and the others wait: call it from threads that no thread pool lends out, or they may wait for themselves.
    /// Cost of a step that is taken over: its files are read once to compare their digests.
    pub fn step(
        &self,
        name: &str,
        key: Key,
        published: &[PathBuf],
        make: impl FnOnce(&StepDir) -> Result<()>,
    ) -> Result<(StepDir, Origin)> {
        let path = match self.keeps {
            Keeps::Newest => self.folder.join(name),
            Keeps::Every => self.folder.join(name).join(&key.as_str()[..VERSION_DIGITS]),
        };
        let turn = {
            let mut turns = self.turns.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(turns.entry(path.clone()).or_default())
        };
        let _mine = turn.lock().unwrap_or_else(PoisonError::into_inner);
        let identity = (path.clone(), key.as_str().to_owned());
        let dir = StepDir::open(path, key)?;
        if self.sound().contains(&identity) && published.is_empty() {
            return Ok((dir, Origin::Found));
        }
        let origin = match dir.state(published) {
            State::Done => Origin::Found,
            State::Unfinished => Origin::Made,
            State::Damaged(why) => {
                dir.empty()?;
                Origin::MadeAgain(why)
            }
        };
        if origin != Origin::Found {
            make(&dir)?;
            dir.finish(published)?;
        }
        self.sound().insert(identity);
        Ok((dir, origin))
    }

    fn sound(&self) -> MutexGuard<'_, BTreeSet<(PathBuf, String)>> {
        self.sound.lock().unwrap_or_else(PoisonError::into_inner)
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

/// What is known of a step's files.
#[derive(Clone, Debug, PartialEq, Eq)]
enum State {
    /// Some are still to be made.
    Unfinished,
    /// All are there, as they were left.
    Done,
    /// Something differs from how it was left, for this reason.
    Damaged(String),
}

/// The key that a folder was made under.
const STAMP: &str = "step.json";
/// What the step stands for, once all of it is there.
const DONE: &str = "done";

impl StepDir {
    /// Opens the folder of a step, emptied first if it was made under another key.
    ///
    /// Errors: something lies there that no step made; a file cannot be written or removed.
    pub fn open(path: PathBuf, key: Key) -> Result<Self> {
        let dir = Self { path, key };
        if fs::read_to_string(dir.file(STAMP)).ok().as_deref() != Some(dir.key.as_str()) {
            dir.empty()?;
        }
        Ok(dir)
    }

    /// What the step's result depends on.
    pub fn key(&self) -> &Key {
        &self.key
    }

    /// Removes every file and begins anew. The stamp goes last: a folder without one is none of ours.
    fn empty(&self) -> Result<()> {
        let stamp = self.file(STAMP);
        if self.path.exists() {
            let files = files_of(&self.path, &[STAMP])?;
            if !files.is_empty() && !stamp.exists() {
                return Err(Error::Output {
                    path: self.path.clone(),
                    message: "files that stonewise did not make lie where a step works: move them away"
                        .to_owned(),
                });
            }
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
    fn state(&self, published: &[PathBuf]) -> State {
        if !self.file(DONE).exists() {
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
        match own.chain(outside).find_map(|(k, path)| k.differs(&path)) {
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

    /// Notes that one unit of the step's work is there: these files, relative to the folder.
    pub fn keep(&self, unit: &str, files: &[&str]) -> Result<()> {
        let kept = files
            .iter()
            .map(|name| Kept::of(&self.file(name), PathBuf::from(name)))
            .collect::<Result<Vec<_>>>()?;
        write_json(&self.file(format!("{unit}.kept")), &kept)
    }

    /// Whether a unit of the step's work is there, as it was left.
    pub fn has(&self, unit: &str) -> bool {
        let kept = self.record(&format!("{unit}.kept"));
        kept.is_some_and(|all| all.iter().all(|k| k.differs(&self.file(&k.file)).is_none()))
    }

    fn record(&self, name: &str) -> Option<Vec<Kept>> {
        serde_json::from_slice(&fs::read(self.file(name)).ok()?).ok()
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

/// Digest of a file, or of all files of a folder and below with their names. A link that leads back to a folder above
/// itself is left out.
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
        assert!(again.file("unit").exists());
        assert_eq!(again.state(&[]), State::Unfinished);
        again.finish(&[]).unwrap();
        assert_eq!(step.state(&[]), State::Done);
        let other = open(2);
        assert!(!other.file("unit").exists());
        assert_eq!(other.state(&[]), State::Unfinished);
    }

    /// What a step finds after `spoil` changed its folder and what it published; and what it leaves.
    fn after(spoil: impl FnOnce(&Path, &Path)) -> (Origin, String, String) {
        let work = tempfile::tempdir().unwrap();
        let published = work.path().join("cloud.laz");
        let step = |store: &StepStore| {
            let make = |dir: &StepDir| {
                write_text(&dir.file("tile"), "some points")?;
                write_text(&published, "labelled points")
            };
            let outputs = [published.clone()];
            store.step("a", Key::new("a", &0, &[]), &outputs, make).unwrap().1
        };
        let store = || StepStore::new(&work.path().join("work"), Keeps::Newest).unwrap();
        assert_eq!(step(&store()), Origin::Made);
        assert_eq!(step(&store()), Origin::Found);
        spoil(&work.path().join("work/a"), &published);
        let origin = step(&store());
        let read = |path: &Path| fs::read_to_string(path).unwrap();
        assert_eq!(step(&store()), Origin::Found);
        (origin, read(&work.path().join("work/a/tile")), read(&published))
    }

    #[test]
    fn damaged_truncated_and_missing_files_are_made_again_with_the_reason() {
        type Spoil = fn(&Path, &Path);
        let cases: [(&str, Spoil); 6] = [
            ("changed or damaged", |dir, _| {
                fs::write(dir.join("tile"), "some pointz").unwrap()
            }),
            ("5 bytes instead of 11", |dir, _| {
                fs::write(dir.join("tile"), "some ").unwrap()
            }),
            ("tile is missing", |dir, _| {
                fs::remove_file(dir.join("tile")).unwrap()
            }),
            ("done is damaged", |dir, _| {
                fs::write(dir.join("done"), "[{").unwrap()
            }),
            ("cloud.laz is missing", |_, cloud| fs::remove_file(cloud).unwrap()),
            ("cloud.laz was changed", |_, cloud| {
                fs::write(cloud, "labelled pointz").unwrap()
            }),
        ];
        for (expected, spoil) in cases {
            let (origin, tile, cloud) = after(spoil);
            assert!(
                matches!(&origin, Origin::MadeAgain(why) if why.contains(expected)),
                "{expected}: {origin:?}"
            );
            assert_eq!(
                (tile.as_str(), cloud.as_str()),
                ("some points", "labelled points"),
                "{expected}"
            );
        }
    }

    #[test]
    fn a_unit_of_an_unfinished_step_is_taken_over_only_as_it_was_left() {
        let work = tempfile::tempdir().unwrap();
        let step = StepDir::open(work.path().join("a"), Key::new("a", &1, &[])).unwrap();
        fs::write(step.file("1.png"), "labels").unwrap();
        assert!(!step.has("1"));
        step.keep("1", &["1.png"]).unwrap();
        assert!(step.has("1") && !step.has("2"));
        fs::write(step.file("1.png"), "labelz").unwrap();
        assert!(!step.has("1"));
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
                    let (dir, _) = store.step("a", key, &[], make).unwrap();
                    assert!(dir.file("unit").exists());
                });
            }
        });
        assert_eq!(made.into_inner(), 2);
        let newest = StepStore::new(work.path(), Keeps::Newest).unwrap();
        let other = newest.step("b", Key::new("b", &0, &[]), &[], |_| Ok(())).unwrap();
        assert_eq!(
            (other.0.path(), other.1),
            (work.path().join("b").as_path(), Origin::Made)
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
