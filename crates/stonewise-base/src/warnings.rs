//! What went wrong without stopping the run.

use serde::{Deserialize, Serialize};
use std::sync::{Mutex, PoisonError};

/// One thing that a user must be told.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Warning {
    /// The step that met it.
    pub step: String,
    /// The photo, camera, file or stone that it is about.
    pub subject: String,
    /// What happened, and what to do about it.
    pub message: String,
    /// An input of the project was left out: the run ends with exit code 3.
    pub skipped_input: bool,
    /// The results as a whole cannot be relied on: the run ends with exit code 3, and says so before anything
    /// else.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub doubt: bool,
}

/// Collects warnings from all threads.
#[derive(Default)]
pub struct Warnings(Mutex<Vec<Warning>>);

impl Warnings {
    /// Something worth knowing that left nothing out.
    pub fn notice(&self, step: &str, subject: impl Into<String>, message: impl Into<String>) {
        self.push(Warning {
            step: step.into(),
            subject: subject.into(),
            message: message.into(),
            skipped_input: false,
            doubt: false,
        });
    }

    /// An input was left out.
    pub fn skipped(&self, step: &str, subject: impl Into<String>, message: impl Into<String>) {
        self.push(Warning {
            step: step.into(),
            subject: subject.into(),
            message: message.into(),
            skipped_input: true,
            doubt: false,
        });
    }

    /// The results as a whole cannot be relied on.
    pub fn doubt(&self, step: &str, subject: impl Into<String>, message: impl Into<String>) {
        self.push(Warning {
            step: step.into(),
            subject: subject.into(),
            message: message.into(),
            skipped_input: false,
            doubt: true,
        });
    }

    /// Adds a warning that was made elsewhere, once.
    pub fn push(&self, warning: Warning) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if !all.contains(&warning) {
            all.push(warning);
        }
    }

    /// All warnings so far, sorted, so that their order does not depend on threads.
    pub fn sorted(&self) -> Vec<Warning> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        all.sort();
        all
    }
}
