//! What an interrupted simulation has finished.

use crate::files::{read_json, write_json};
use crate::simulate::{SimulateError, SurveyParams};
use crate::storage::step::Key;
use crate::storage::step::StepDir;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::Path;

/// A folder beside the survey that says which of its files are whole, and what else must be known about them.
/// It is there only while the survey is being made.
pub(super) struct Unfinished(StepDir);

impl Unfinished {
    /// Takes up an interrupted simulation of the same parameters by the same program, or begins a new one.
    pub fn open(survey: &Path, params: &SurveyParams) -> Result<Self, SimulateError> {
        let key = Key::new("survey", params, &[]);
        let step = StepDir::open(survey.join("unfinished"), key).map_err(unfinished)?;
        Ok(Self(step))
    }

    /// What was kept when a part was finished; `None` where it was not.
    pub fn read<T: for<'a> Deserialize<'a>>(&self, part: &str) -> Option<T> {
        read_json(&self.0.file(part)).ok()
    }

    /// Notes that the files of a part are whole.
    pub fn write(&self, part: &str, known: &impl Serialize) -> Result<(), SimulateError> {
        write_json(&self.0.file(part), known).map_err(unfinished)
    }

    /// Nothing is left to be done.
    pub fn remove(self) -> Result<(), SimulateError> {
        let path = self.0.path().to_path_buf();
        fs::remove_dir_all(&path).map_err(|source| SimulateError::Write { path, source })
    }
}

fn unfinished(error: impl std::error::Error + Send + Sync + 'static) -> SimulateError {
    SimulateError::Unfinished(Box::new(error))
}
