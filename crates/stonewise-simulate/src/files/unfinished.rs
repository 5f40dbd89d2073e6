//! What an interrupted simulation has finished.

use crate::files::{SimulateError, SurveyParams};
use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use stonewise_io::atomic::write_atomically;

/// A folder beside the survey that says which of its files are whole, and what else must be known about them.
/// It is there only while the survey is being made.
pub(super) struct Unfinished(PathBuf);

/// What the survey is made from; a folder without this file is not of a simulation.
const MADE_FROM: &str = "made_from.json";

impl Unfinished {
    /// Takes up an interrupted simulation of the same parameters by the same program, or begins a new one.
    pub fn open(survey: &Path, params: &SurveyParams) -> Result<Self, SimulateError> {
        let unfinished = Self(survey.join("unfinished"));
        let made_from = unfinished.json(&(params, program()))?;
        if fs::read_to_string(unfinished.0.join(MADE_FROM)).ok() != Some(made_from.clone()) {
            unfinished.clear()?;
            let stamp = unfinished.0.join(MADE_FROM);
            fs::write(stamp, &made_from).map_err(|source| unfinished.failed(source))?;
        }
        Ok(unfinished)
    }

    /// What was kept when a part was finished; `None` where it was not.
    pub fn read<T: for<'a> Deserialize<'a>>(&self, part: &str) -> Option<T> {
        serde_json::from_slice(&fs::read(self.0.join(part)).ok()?).ok()
    }

    /// Notes that the files of a part are whole.
    pub fn write(&self, part: &str, known: &impl Serialize) -> Result<(), SimulateError> {
        self.write_text(part, &self.json(known)?)
    }

    /// Nothing is left to be done.
    pub fn remove(self) -> Result<(), SimulateError> {
        fs::remove_dir_all(&self.0).map_err(|source| self.failed(source))
    }

    /// An empty folder but for [`MADE_FROM`], which is replaced last.
    fn clear(&self) -> Result<(), SimulateError> {
        fs::create_dir_all(&self.0).map_err(|source| self.failed(source))?;
        let is_ours = self.0.join(MADE_FROM).exists();
        for entry in fs::read_dir(&self.0).map_err(|source| self.failed(source))? {
            let path = entry.map_err(|source| self.failed(source))?.path();
            if !is_ours {
                return Err(SimulateError::Occupied { path: self.0.clone() });
            }
            if !path.ends_with(MADE_FROM) {
                fs::remove_file(&path).map_err(|source| self.failed(source))?;
            }
        }
        Ok(())
    }

    fn json(&self, value: &impl Serialize) -> Result<String, SimulateError> {
        serde_json::to_string(value).map_err(|error| self.failed(error.into()))
    }

    fn write_text(&self, part: &str, text: &str) -> Result<(), SimulateError> {
        write_atomically(&self.0.join(part), |partial| fs::write(partial, text))
            .map_err(|source| self.failed(source))
    }

    fn failed(&self, source: io::Error) -> SimulateError {
        let path = self.0.clone();
        SimulateError::Write { path, source }
    }
}

/// What tells this program from another build: its version, and length and time of its file.
fn program() -> (&'static str, Option<(u64, SystemTime)>) {
    let file = std::env::current_exe().and_then(fs::metadata);
    let stamp = file.and_then(|file| Ok((file.len(), file.modified()?)));
    (env!("CARGO_PKG_VERSION"), stamp.ok())
}
