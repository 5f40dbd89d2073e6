//! Steps that keep their results and resume, in the folders of a store.

use super::step::{Key, Look, Origin, StepDir, discard, path_digest};
use crate::error::{Error, Result};
use crate::files::create_results_folder;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use stonewise_segment::Weights;

/// How many versions of a step's files are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeps {
    /// One: a step that is done under another key replaces its files. For a project that is run again and
    /// again.
    Newest,
    /// One for each key. For experiments, whose variants share what they have in common.
    Every,
}

/// The folder that holds the folders of all steps: that of each version is named after its key.
pub struct StepStore {
    folder: PathBuf,
    keeps: Keeps,
    look: Look,
    /// One for each folder in which somebody works.
    turns: Mutex<BTreeMap<PathBuf, Arc<Mutex<()>>>>,
    digests: Mutex<BTreeMap<PathBuf, String>>,
    /// Folders of the steps whose files this process has compared with their digests or made itself.
    sound: Mutex<BTreeSet<PathBuf>>,
}

impl StepStore {
    /// A store in a folder, which is made if need be.
    pub fn new(folder: &Path, keeps: Keeps) -> Result<Self> {
        create_results_folder(folder)?;
        Ok(Self {
            folder: folder.to_path_buf(),
            keeps,
            look: Look::Digests,
            turns: Mutex::default(),
            digests: Mutex::default(),
            sound: Mutex::default(),
        })
    }

    /// The store of a run of which this process does one unit: what others have made is only looked at, and none
    /// of it is removed. `digests`: of the inputs, as the plan lists them.
    pub fn of_unit(folder: &Path, digests: BTreeMap<PathBuf, String>) -> Result<Self> {
        Ok(Self {
            look: Look::Lengths,
            digests: Mutex::new(digests),
            ..Self::new(folder, Keeps::Every)?
        })
    }

    /// Does a step with `make`, unless its files are there under this key, as they were left.
    ///
    /// `folder`: that of all versions; steps that share it find what any of them has made under the same key.
    /// `published`: files outside the step's folder that it makes too. Of several threads that start the same
    /// step one does it and the others wait: call it from threads that no thread pool lends out, or they may
    /// wait for themselves. Cost of a step that is taken over: its files are read once to compare their
    /// digests.
    pub fn step(
        &self,
        folder: &str,
        key: Key,
        published: &[PathBuf],
        make: impl FnOnce(&StepDir) -> Result<()>,
    ) -> Result<(StepDir, Origin)> {
        self.do_at(self.path(folder, &key), key, published, make)
    }

    /// Makes a part of a step: a step of its own, which lies beside the whole until that is done.
    pub fn part(
        &self,
        (whole, key): (&str, &Key),
        part: &str,
        make: impl FnOnce(&StepDir) -> Result<()>,
    ) -> Result<StepDir> {
        let path = self.parts(whole, key).join(part);
        let key = Key::new("part", &part, &[key.as_str()]);
        Ok(self.do_at(path, key, &[], make)?.0)
    }

    /// Removes the parts of a step that is done.
    pub fn remove_parts(&self, whole: &str, key: &Key) -> Result<()> {
        discard(&self.parts(whole, key))
    }

    fn do_at(
        &self,
        path: PathBuf,
        key: Key,
        published: &[PathBuf],
        make: impl FnOnce(&StepDir) -> Result<()>,
    ) -> Result<(StepDir, Origin)> {
        let turn = {
            let mut turns = self.turns.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(turns.entry(path.clone()).or_default())
        };
        let _mine = turn.lock().unwrap_or_else(PoisonError::into_inner);
        let dir = StepDir::at(path, key);

        if self.sound().contains(dir.path()) && published.is_empty() {
            return Ok((dir, Origin::Found));
        }
        let origin = dir.origin(published, self.look);
        if origin != Origin::Found {
            if self.keeps == Keeps::Newest {
                self.remove_versions(dir.path().parent(), Some(dir.path()))?;
            }
            dir.replace(published, make)?;
        }

        self.sound().insert(dir.path().to_path_buf());
        Ok((dir, origin))
    }

    /// Removes all versions of steps that this process has neither made nor found; only for the last process
    /// that works on a run, once it has been through all steps.
    pub fn remove_unused(&self) -> Result<()> {
        for entry in fs::read_dir(&self.folder).map_err(Error::io("listing", &self.folder))? {
            let path = entry.map_err(Error::io("listing", &self.folder))?.path();
            if path.is_dir() {
                self.remove_versions(Some(&path), None)?;
            }
        }
        Ok(())
    }

    /// Removes the versions of a step that this process does not use, and their parts; `kept`: one of them.
    fn remove_versions(&self, folder: Option<&Path>, kept: Option<&Path>) -> Result<()> {
        let Some(entries) = folder.and_then(|f| fs::read_dir(f).ok()) else {
            return Ok(());
        };
        let used = self.sound().clone();
        for entry in entries.flatten() {
            let path = entry.path();
            let whole = path.with_extension("");
            let is_used = kept == Some(whole.as_path()) || used.contains(&whole);
            if is_version(&whole) && !is_used {
                discard(&path)?;
            }
        }
        Ok(())
    }

    fn path(&self, folder: &str, key: &Key) -> PathBuf {
        self.folder.join(folder).join(&key.as_str()[..VERSION_DIGITS])
    }

    fn parts(&self, whole: &str, key: &Key) -> PathBuf {
        self.path(whole, key).with_extension("parts")
    }

    fn sound(&self) -> MutexGuard<'_, BTreeSet<PathBuf>> {
        self.sound.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a step was done under this key, in whatever state its files are now.
    pub fn has(&self, folder: &str, key: &Key) -> bool {
        self.path(folder, key).exists()
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

    /// Digest of the weights of a detector.
    pub fn weights_digest(&self, weights: &Weights) -> Result<String> {
        match weights {
            Weights::BuiltIn => Ok(blake3::hash(&weights.bytes()?).to_hex().to_string()),
            Weights::File(path) => self.digest(path),
        }
    }
}

/// Digits of a key that name one version of a step's files.
const VERSION_DIGITS: usize = 16;

/// Whether a folder has the name of a version.
fn is_version(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.len() == VERSION_DIGITS && name.bytes().all(|b| b.is_ascii_hexdigit())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_text;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// The folder of the only version of a step, without parts.
    fn only_version(folder: &Path) -> PathBuf {
        let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
        let versions: Vec<PathBuf> = entries.collect();
        assert_eq!(versions.len(), 1, "{versions:?}");
        versions.into_iter().next().unwrap()
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
        let dir = only_version(&work.path().join("work/a"));
        spoil(&dir, &published);
        let origin = step(&store());
        let read = |path: &Path| fs::read_to_string(path).unwrap();
        assert_eq!(step(&store()), Origin::Found);
        (origin, read(&dir.join("tile")), read(&published))
    }

    #[test]
    fn damaged_truncated_and_missing_files_are_made_again_with_the_reason() {
        type Spoil = fn(&Path, &Path);
        let cases: [(&str, Spoil); 7] = [
            ("changed or damaged", |dir, _| {
                fs::write(dir.join("tile"), "some pointz").unwrap()
            }),
            ("5 bytes instead of 11", |dir, _| {
                fs::write(dir.join("tile"), "some ").unwrap()
            }),
            ("tile is missing", |dir, _| {
                fs::remove_file(dir.join("tile")).unwrap()
            }),
            ("done is missing or damaged", |dir, _| {
                fs::write(dir.join("done"), "[{").unwrap()
            }),
            ("done is missing or damaged", |dir, _| {
                fs::remove_file(dir.join("done")).unwrap()
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
        // Another process adds a version and finds those of the first.
        let later = StepStore::new(work.path(), Keeps::Every).unwrap();
        let origin = |version: i32| {
            let key = Key::new("a", &version, &[]);
            later.step("a", key, &[], |_| Ok(())).unwrap().1
        };
        assert_eq!(
            [2, 0, 1].map(origin),
            [Origin::Made, Origin::Found, Origin::Found]
        );
        let newest = StepStore::new(work.path(), Keeps::Newest).unwrap();
        let other = newest.step("b", Key::new("b", &0, &[]), &[], |_| Ok(())).unwrap();
        assert_eq!(
            (other.0.path(), other.1),
            (only_version(&work.path().join("b")).as_path(), Origin::Made)
        );
    }

    #[test]
    fn what_fails_or_is_stale_leaves_nothing_and_parts_go_with_the_whole() {
        let work = tempfile::tempdir().unwrap();
        let store = StepStore::new(work.path(), Keeps::Newest).unwrap();
        let key = Key::new("a", &0, &[]);
        let failed = store.step("a", key.clone(), &[], |dir| {
            write_text(&dir.file("half"), "x")?;
            Err(Error::Survey("no".to_owned()))
        });
        assert!(failed.is_err() && fs::read_dir(work.path().join("a")).unwrap().count() == 0);
        let gather = |dir: &StepDir| {
            for name in ["1", "2"] {
                let part = store.part(("a", &key), name, |part| write_text(&part.file("text"), name))?;
                dir.take(&part, "text", name)?;
            }
            Ok(())
        };
        let (dir, _) = store.step("a", key.clone(), &[], gather).unwrap();
        assert!(dir.path().with_extension("parts").join("2/done").exists());
        store.remove_parts("a", &key).unwrap();
        assert_eq!(fs::read_to_string(dir.file("2")).unwrap(), "2");
        assert_eq!(only_version(&work.path().join("a")), dir.path());
    }

    #[test]
    fn a_new_version_replaces_what_this_run_has_not_used_and_nothing_that_is_not_ours() {
        let work = tempfile::tempdir().unwrap();
        let make = |store: &StepStore, version: u32| {
            let key = Key::new("match", &version, &[]);
            store
                .step("match", key, &[], |dir| write_text(&dir.file("x"), "x"))
                .unwrap()
        };
        let count = || fs::read_dir(work.path().join("match")).unwrap().count();
        let store = StepStore::new(work.path(), Keeps::Newest).unwrap();
        make(&store, 0);
        make(&store, 1);
        assert_eq!(make(&store, 0).1, Origin::Found);
        // The name of a version has sixteen digits; that of somebody else's folder may have sixteen letters.
        let others = ["match/thesis.tex", "match/measured-by-hand"].map(|name| work.path().join(name));
        fs::write(&others[0], "x").unwrap();
        fs::create_dir(&others[1]).unwrap();
        fs::write(others[1].join("done"), "x").unwrap();
        assert_eq!(count(), 4);

        let later = StepStore::new(work.path(), Keeps::Newest).unwrap();
        assert_eq!(make(&later, 0).1, Origin::Found);
        make(&later, 2);
        assert_eq!(count(), 4);
        assert_eq!(make(&later, 2).1, Origin::Found);

        let last = StepStore::new(work.path(), Keeps::Newest).unwrap();
        make(&last, 2);
        last.remove_unused().unwrap();
        assert_eq!(count(), 3);
        assert!(others.iter().all(|path| path.exists()));
    }
}
