//! Corrections by hand: a journal that is on the disk before anything is answered, and the file of edits that runs
//! read.
//!
//! The journal lies beside the file of edits and only grows, one line for each act: what was added, undone, done
//! again. The file of edits is written anew after each act, whole or not at all. Whatever a kill leaves, the journal
//! has every act that was answered, and each once: a torn last line was never answered, and an act that is sent again
//! has the name of the first.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use stonewise::edits::{Edit, EditsFile};
use stonewise::results::Facade;
use stonewise::{Error, Result};

/// One line of the journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "act", rename_all = "snake_case")]
enum Act {
    /// The file of edits holds these, whoever wrote them.
    Base {
        edits: Vec<Edit>,
        /// The unrolled wall on which they were drawn.
        facade: Option<Value>,
    },
    /// A person added these edits, which are undone together.
    Add {
        id: String,
        edits: Vec<Edit>,
        /// The unrolled wall on which they were drawn, where none is known yet.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        facade: Option<Value>,
    },
    /// The last act that is not undone is undone.
    Undo { id: String },
    /// The last act that was undone is done again.
    Redo { id: String },
}

/// What the acts so far make.
#[derive(Clone, Debug, Default, PartialEq)]
struct State {
    base: Vec<Edit>,
    facade: Option<Value>,
    done: Vec<Vec<Edit>>,
    undone: Vec<Vec<Edit>>,
    /// Names of all acts.
    ids: Vec<String>,
}

impl State {
    fn apply(&mut self, act: &Act) {
        match act {
            Act::Base { edits, facade } => {
                self.base.clone_from(edits);
                self.facade.clone_from(facade);
                self.done.clear();
                self.undone.clear();
            }
            Act::Add { edits, facade, .. } => {
                if facade.is_some() {
                    self.facade.clone_from(facade);
                }
                self.done.push(edits.clone());
                self.undone.clear();
            }
            Act::Undo { .. } => self.undone.extend(self.done.pop()),
            Act::Redo { .. } => self.done.extend(self.undone.pop()),
        }
        match act {
            Act::Base { .. } => {}
            Act::Add { id, .. } | Act::Undo { id } | Act::Redo { id } => self.ids.push(id.clone()),
        }
    }

    fn edits(&self) -> Vec<Edit> {
        self.base
            .iter()
            .chain(self.done.iter().flatten())
            .cloned()
            .collect()
    }
}

/// The journal of one file of edits.
pub struct Journal {
    file: PathBuf,
    journal: File,
    state: State,
}

impl Journal {
    /// Opens the journal of a file of edits; neither need be there.
    ///
    /// # Errors
    /// One of them cannot be read or written, or is damaged other than by a kill.
    pub fn open(file: &Path) -> Result<Self> {
        let path = journal_of(file);
        let (acts, whole) = read(&path)?;
        let mut journal = OpenOptions::new()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .open(&path)
            .map_err(io_error("opening the journal of edits", &path))?;
        let torn = io_error("cutting the torn end of the journal", &path);
        journal
            .set_len(whole)
            .and_then(|()| journal.seek(SeekFrom::End(0)))
            .map_err(torn)?;
        sync_folder(&path);
        let mut state = State::default();
        let mut before = None;
        for act in &acts {
            before = Some((state.edits(), state.facade.is_some()));
            state.apply(act);
        }
        let mut this = Self {
            file: file.to_path_buf(),
            journal,
            state,
        };
        this.agree_with_file(before)?;
        Ok(this)
    }

    /// A kill between the journal and the file leaves the file one act behind; anything else in the file is a person's
    /// or another program's, and holds.
    fn agree_with_file(&mut self, before: Option<(Vec<Edit>, bool)>) -> Result<()> {
        let now = (self.state.edits(), self.state.facade.is_some());
        if !self.file.exists() {
            return match now.0.is_empty() {
                true => Ok(()),
                false => self.write_file(),
            };
        }
        let written = EditsFile::read(&self.file)?;
        // Numbers of an unrolled wall change in their last digits when they are read; that there is one does not.
        let found = (written.edits, written.facade.is_some());
        if found == now {
            return Ok(());
        }
        if before.as_ref() == Some(&found) {
            return self.write_file();
        }
        let facade = written.facade.as_ref().map(|f| self.json(f)).transpose()?;
        self.act(Act::Base {
            edits: found.0,
            facade,
        })
    }

    /// Adds edits that are one act for the person; `false` where an act of this name was added before. `facade`: the
    /// unrolled wall on which they were drawn, which the first of them fixes.
    ///
    /// # Errors
    /// The journal or the file of edits cannot be written.
    pub fn add(
        &mut self,
        id: &str,
        edits: Vec<Edit>,
        facade: impl FnOnce() -> Result<Facade>,
    ) -> Result<bool> {
        if self.contains(id) {
            return Ok(false);
        }
        // Edits without it were drawn on the wall of the run without edits, which results with edits keep.
        let is_first = self.state.facade.is_none() && self.state.edits().is_empty();
        let facade = if is_first {
            Some(self.json(&facade()?)?)
        } else {
            None
        };
        self.act(Act::Add {
            id: id.to_owned(),
            edits,
            facade,
        })?;
        Ok(true)
    }

    /// Undoes the last act; `false` where there is none, or an act of this name was done before.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub fn undo(&mut self, id: &str) -> Result<bool> {
        let may = !self.contains(id) && self.can_undo();
        if may {
            self.act(Act::Undo { id: id.to_owned() })?;
        }
        Ok(may)
    }

    /// Does the last undone act again; `false` as for [`Self::undo`].
    ///
    /// # Errors
    /// As [`Self::add`].
    pub fn redo(&mut self, id: &str) -> Result<bool> {
        let may = !self.contains(id) && self.can_redo();
        if may {
            self.act(Act::Redo { id: id.to_owned() })?;
        }
        Ok(may)
    }

    /// The edits as the file of edits holds them.
    pub fn edits(&self) -> Vec<Edit> {
        self.state.edits()
    }

    /// The file of edits.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Whether there is an act to undo.
    pub fn can_undo(&self) -> bool {
        !self.state.done.is_empty()
    }

    /// Whether there is an undone act.
    pub fn can_redo(&self) -> bool {
        !self.state.undone.is_empty()
    }

    fn contains(&self, id: &str) -> bool {
        self.state.ids.iter().any(|known| known == id)
    }

    fn act(&mut self, act: Act) -> Result<()> {
        self.write_act(&act)?;
        self.write_file()
    }

    /// On the disk first; then it counts.
    fn write_act(&mut self, act: &Act) -> Result<()> {
        let path = journal_of(&self.file);
        let json = self.json(act)?;
        let end = self
            .journal
            .stream_position()
            .map_err(io_error("writing", &path))?;
        let written = self
            .journal
            .write_all(format!("{json}\n").as_bytes())
            .and_then(|()| self.journal.sync_data());
        if let Err(source) = written {
            // What is not whole must not stand before the next act.
            let _ = self.journal.set_len(end);
            let _ = self.journal.seek(SeekFrom::Start(end));
            return Err(io_error("writing", &path)(source));
        }
        self.state.apply(act);
        Ok(())
    }

    fn json(&self, value: &impl Serialize) -> Result<Value> {
        serde_json::to_value(value).map_err(self.no_json())
    }

    fn no_json(&self) -> impl Fn(serde_json::Error) -> Error + '_ {
        |error| Error::Input {
            path: journal_of(&self.file),
            message: format!("cannot be written as JSON ({error})"),
        }
    }

    fn write_file(&self) -> Result<()> {
        let facade = self.state.facade.as_ref().map(Facade::deserialize);
        EditsFile {
            facade: facade.transpose().map_err(self.no_json())?,
            edits: self.state.edits(),
            ..EditsFile::empty(&self.file)
        }
        .write()
    }
}

/// The journal's path: `edits.journal` beside `edits.json`.
fn journal_of(file: &Path) -> PathBuf {
    file.with_extension("journal")
}

fn io_error<'a>(action: &'static str, path: &'a Path) -> impl FnOnce(io::Error) -> Error + 'a {
    move |cause| Error::Io {
        action,
        path: path.to_path_buf(),
        cause,
    }
}

/// A new file's name is on the disk once its folder is.
fn sync_folder(path: &Path) {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
        let _ = folder.sync_all();
    }
}

/// The acts of a journal, and the length of its whole lines.
fn read(path: &Path) -> Result<(Vec<Act>, u64)> {
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == io::ErrorKind::NotFound => Vec::new(),
        Err(e) => return Err(io_error("reading", path)(e)),
    };
    let (mut acts, mut whole) = (Vec::new(), 0);
    for (line, number) in bytes.split_inclusive(|b| *b == b'\n').zip(1..) {
        if line.last() != Some(&b'\n') {
            break;
        }
        let act = serde_json::from_slice(line).map_err(|e| Error::Project {
            path: path.to_path_buf(),
            line: number,
            message: format!("this is no line of a journal ({e}); move the file away to go on without undo"),
        })?;
        acts.push(act);
        whole += line.len() as u64;
    }
    Ok((acts, whole))
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise::edits::Action;

    fn edit(along: f64) -> Edit {
        Edit {
            action: Action::Delete,
            photo: None,
            epoch: None,
            epochs: None,
            at: vec![[along, 1.0]],
            line: Vec::new(),
            outline: Vec::new(),
            corners: Vec::new(),
            who: "A. Keller".to_owned(),
            when: "2026-11-20".to_owned(),
            why: "door".to_owned(),
        }
    }

    fn wall() -> Result<Facade> {
        Ok(Facade::new(&[]))
    }

    fn places(edits: &[Edit]) -> Vec<f64> {
        edits.iter().map(|e| e.at[0][0]).collect()
    }

    #[test]
    fn undone_and_redone_edits_are_in_the_file_that_a_run_reads() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("edits.json");
        let mut journal = Journal::open(&file).unwrap();
        for n in 0..3 {
            assert!(
                journal
                    .add(&format!("a{n}"), vec![edit(f64::from(n))], wall)
                    .unwrap()
            );
        }
        assert!(!journal.add("a1", vec![edit(9.0)], wall).unwrap());
        journal.undo("u1").unwrap();
        journal.undo("u2").unwrap();
        assert!(!journal.undo("u2").unwrap());
        journal.redo("r1").unwrap();
        let read = EditsFile::read(&file).unwrap();
        assert_eq!(places(&read.edits), [0.0, 1.0]);
        assert!(read.facade.is_some());
        drop(journal);
        let mut again = Journal::open(&file).unwrap();
        assert!(again.can_redo());
        again.redo("r2").unwrap();
        assert_eq!(places(&EditsFile::read(&file).unwrap().edits), [0.0, 1.0, 2.0]);
        assert!(!again.can_redo());
    }

    #[test]
    fn whatever_a_kill_leaves_no_answered_edit_is_lost_or_doubled() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("edits.json");
        let mut journal = Journal::open(&file).unwrap();
        journal.add("a", vec![edit(1.0)], wall).unwrap();
        let old_file = fs::read(&file).unwrap();
        journal.add("b", vec![edit(2.0)], wall).unwrap();
        drop(journal);
        let path = journal_of(&file);
        let bytes = fs::read(&path).unwrap();
        let second = bytes.len() - bytes.split_inclusive(|b| *b == b'\n').next_back().unwrap().len();
        // Killed while the line of "b" was written: at every byte of it.
        for cut in second..bytes.len() {
            fs::write(&path, &bytes[..cut]).unwrap();
            fs::write(&file, &old_file).unwrap();
            let mut journal = Journal::open(&file).unwrap();
            assert_eq!(places(&journal.edits()), [1.0], "{cut}");
            // The page sends it again.
            assert!(journal.add("b", vec![edit(2.0)], wall).unwrap());
            assert_eq!(places(&EditsFile::read(&file).unwrap().edits), [1.0, 2.0]);
        }
        // Killed before the file of edits was written: the line is whole, the answer was not sent.
        fs::write(&path, &bytes).unwrap();
        fs::write(&file, &old_file).unwrap();
        let mut journal = Journal::open(&file).unwrap();
        assert!(!journal.add("b", vec![edit(2.0)], wall).unwrap());
        assert_eq!(places(&EditsFile::read(&file).unwrap().edits), [1.0, 2.0]);
    }

    #[test]
    fn edits_that_someone_wrote_into_the_file_hold() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("edits.json");
        let mut journal = Journal::open(&file).unwrap();
        journal.add("a", vec![edit(1.0)], wall).unwrap();
        drop(journal);
        let by_hand = EditsFile {
            edits: vec![edit(7.0), edit(8.0)],
            ..EditsFile::empty(&file)
        };
        by_hand.write().unwrap();
        let mut journal = Journal::open(&file).unwrap();
        assert_eq!(places(&journal.edits()), [7.0, 8.0]);
        assert!(!journal.can_undo());
        journal.add("b", vec![edit(9.0)], wall).unwrap();
        journal.undo("u").unwrap();
        assert_eq!(places(&EditsFile::read(&file).unwrap().edits), [7.0, 8.0]);
    }
}
