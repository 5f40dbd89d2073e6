//! One epoch of a simulated survey that is being written, and the folder it is written into.

use crate::files::unfinished::Unfinished;
use crate::files::{SimulateError, SurveyParams};
use crate::world::World;
use std::path::Path;
use stonewise_core::progress::Progress;

/// One epoch that is being written.
pub(super) struct Survey<'a> {
    pub folder: &'a Path,
    pub world: &'a World,
    pub params: &'a SurveyParams,
    /// 0 or 1.
    pub epoch: usize,
    pub unfinished: &'a Unfinished,
    pub progress: &'a dyn Progress,
}

impl Survey<'_> {
    /// Number of the epoch in names of files.
    pub fn number(&self) -> usize {
        self.epoch + 1
    }
}

/// Makes a folder and those above it.
pub(super) fn create_folder(path: &Path) -> Result<(), SimulateError> {
    std::fs::create_dir_all(path).map_err(|source| SimulateError::Write {
        path: path.to_owned(),
        source,
    })
}
