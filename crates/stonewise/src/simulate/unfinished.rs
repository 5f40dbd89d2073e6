//! What an interrupted simulation has finished.

use crate::pipeline::Key;
use crate::simulate::{SimulateError, SurveyParams};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_io::atomic::write_atomically;

/// A folder beside the survey that says which of its files are whole, and what else must be known about them. It is there
/// only while the survey is being made.
pub(super) struct Unfinished {
    folder: PathBuf,
}

impl Unfinished {
    /// Takes up an interrupted simulation of the same parameters by the same program, or begins a new one.
    pub fn open(survey: &Path, params: &SurveyParams) -> Result<Self, SimulateError> {
        let folder = survey.join("unfinished");
        let key = Key::new("survey", params, &[]);
        let stamp = folder.join("key");
        if fs::read_to_string(&stamp).ok().as_deref() != Some(key.as_str()) {
            if folder.exists() {
                fs::remove_dir_all(&folder).map_err(cannot_write(&folder))?;
            }
            fs::create_dir_all(&folder).map_err(cannot_write(&folder))?;
            write_atomically(&stamp, |partial| fs::write(partial, key.as_str()))
                .map_err(cannot_write(&stamp))?;
        }
        Ok(Self { folder })
    }

    /// What was kept when a part was finished; `None` where it was not.
    pub fn read<T: for<'a> Deserialize<'a>>(&self, part: &str) -> Option<T> {
        let text = fs::read_to_string(self.folder.join(part)).ok()?;
        serde_json::from_str(&text).ok()
    }

    /// Notes that the files of a part are whole.
    pub fn write(&self, part: &str, known: &impl Serialize) -> Result<(), SimulateError> {
        let path = self.folder.join(part);
        write_atomically(&path, |partial| {
            fs::write(
                partial,
                serde_json::to_string(known).map_err(std::io::Error::from)?,
            )
        })
        .map_err(cannot_write(&path))
    }

    /// Nothing is left to be done.
    pub fn remove(self) -> Result<(), SimulateError> {
        fs::remove_dir_all(&self.folder).map_err(cannot_write(&self.folder))
    }
}

fn cannot_write(path: &Path) -> impl FnOnce(std::io::Error) -> SimulateError {
    let path = path.to_path_buf();
    move |source| SimulateError::Write { path, source }
}
