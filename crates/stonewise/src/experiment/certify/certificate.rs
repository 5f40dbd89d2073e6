//! What a certificate says.

use crate::project::Project;
use crate::results::records::Timestamp;
use serde::Serialize;
use std::path::PathBuf;

/// What is certified.
#[derive(Clone, Debug)]
pub struct CertifyOptions {
    /// Seed of the simulated walls and of the halves.
    pub seed: u64,
    /// Number of simulated walls; every second one stands still.
    pub walls: u64,
    /// Whose first epoch is split into halves, into which motions are put; absent: none.
    pub project: Option<Project>,
}

/// One figure with what is allowed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// `walls` or `own`.
    pub part: &'static str,
    /// What it is.
    pub name: String,
    /// The figure; absent where it is not defined.
    pub value: Option<f64>,
    /// The least that is allowed.
    pub least: Option<f64>,
    /// The most that is allowed.
    pub most: Option<f64>,
    /// Whether it is within.
    pub holds: bool,
    /// How it came about.
    pub note: String,
}

/// All figures, and what they were made by.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Certificate {
    /// Version of stonewise.
    pub version: String,
    /// Digest of the program.
    pub program: String,
    /// Class of the processor.
    pub processor: String,
    /// When it was made.
    pub made_at: Timestamp,
    /// The seed.
    pub seed: u64,
    /// The project file whose scans were split.
    pub project: Option<PathBuf>,
    /// Whether all figures are within what is allowed.
    pub holds: bool,
    /// The figures, in order.
    pub figures: Vec<Figure>,
}

impl Figure {
    fn new(part: &'static str, name: impl Into<String>, value: f64, allowed: [Option<f64>; 2]) -> Self {
        let [least, most] = allowed;
        let is_within = least.is_none_or(|l| value >= l) && most.is_none_or(|m| value <= m);
        Self {
            part,
            name: name.into(),
            value: Some(value),
            least,
            most,
            // What is no number is within nothing.
            holds: is_within && value.is_finite(),
            note: String::new(),
        }
    }

    pub(super) fn at_least(part: &'static str, name: impl Into<String>, value: f64, least: f64) -> Self {
        Self::new(part, name, value, [Some(least), None])
    }

    pub(super) fn at_most(part: &'static str, name: impl Into<String>, value: f64, most: f64) -> Self {
        Self::new(part, name, value, [None, Some(most)])
    }

    /// A figure that nothing is demanded of.
    pub(super) fn shown(part: &'static str, name: impl Into<String>, value: Option<f64>) -> Self {
        Self {
            value,
            holds: true,
            ..Self::new(part, name, 0.0, [None, None])
        }
    }

    pub(super) fn with(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }
}
