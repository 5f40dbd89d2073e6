//! What a verification found.

use crate::processor_class;
use crate::results::records::RunRecord;
use crate::storage::step::code_version;
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// What came out of one comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// It is as it should be.
    Holds,
    /// It could not be compared.
    Open,
    /// It is not as it should be.
    Fails,
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Holds => "holds",
            Self::Open => "open",
            Self::Fails => "FAILS",
        })
    }
}

/// One comparison.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Kind of the comparison: `files`, `tables`, `inputs` or `again`.
    pub kind: &'static str,
    /// The file or the group of files.
    pub subject: String,
    /// What came out.
    pub answer: Answer,
    /// What came out, in words.
    pub message: String,
}

impl Finding {
    pub(super) fn new(
        kind: &'static str,
        subject: impl Into<String>,
        answer: Answer,
        message: impl Into<String>,
    ) -> Self {
        Self {
            kind,
            subject: subject.into(),
            answer,
            message: message.into(),
        }
    }

    pub(super) fn of(path: &Path, kind: &'static str, answer: Answer, message: impl Into<String>) -> Self {
        Self::new(kind, path.to_string_lossy(), answer, message)
    }
}

/// Who made results: the bytes of two makers agree where program and processor do.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Maker {
    /// Version of stonewise.
    pub version: String,
    /// Digest of the program; empty where it was not noted.
    pub program: String,
    /// Class of the processor; empty where it was not noted.
    pub processor: String,
}

impl Maker {
    /// This program on this processor.
    pub(super) fn present() -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            program: code_version(),
            processor: processor_class().to_owned(),
        }
    }

    pub(super) fn of(run: &RunRecord) -> Self {
        Self {
            version: run.version.clone(),
            program: run.program.clone(),
            processor: run.processor.clone(),
        }
    }

    /// How it differs from another, in words; `None` where both give the same bytes.
    pub(super) fn differs(&self, other: &Self) -> Option<String> {
        if self.program != other.program {
            return Some("another build of stonewise".to_owned());
        }
        (self.processor != other.processor)
            .then(|| format!("a processor of the class \"{}\"", self.processor))
    }
}

/// All comparisons.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verification {
    /// The worst of all answers.
    pub answer: Answer,
    /// Who made the results.
    pub made_by: Maker,
    /// Who compares them.
    pub verified_by: Maker,
    /// The comparisons, in order.
    pub findings: Vec<Finding>,
}

impl Verification {
    pub(super) fn of(made_by: Maker, findings: Vec<Finding>) -> Self {
        Self {
            answer: { findings.iter().map(|f| f.answer).max() }.unwrap_or(Answer::Open),
            made_by,
            verified_by: Maker::present(),
            findings,
        }
    }
}
