//! Inputs that cannot be read.

use super::Depth;
use super::finding::{Finding, Verdict};
use crate::Epoch;
use stonewise_base::error::{Error, Result};
use stonewise_base::messages::Message;

/// Lines about inputs that cannot be read. A run ends at the first; at full depth the look goes on with what
/// else there is.
pub(super) struct Unreadable {
    depth: Depth,
    /// One line for each error.
    pub findings: Vec<Finding>,
}

impl Unreadable {
    pub fn new(depth: Depth) -> Self {
        Self {
            depth,
            findings: Vec::new(),
        }
    }

    /// What was read; `None` where it could not be, which is then among the findings.
    ///
    /// # Errors
    /// At quick depth, what could not be read; the caller stopped it.
    pub fn keep<T>(&mut self, epoch: &Epoch, topic: &Message, read: Result<T>) -> Result<Option<T>> {
        let error = match read {
            Ok(read) => return Ok(Some(read)),
            Err(error) => error,
        };
        if self.depth == Depth::Quick || matches!(error, Error::Interrupted) {
            return Err(error);
        }
        let finding = Finding::new(&epoch.name, topic, Verdict::Unreadable, error.to_string());
        self.findings.push(finding);
        Ok(None)
    }
}
