//! One run of the experiment: which survey, which motion, which method, and what came out.

use crate::experiment::known_motion::KnownMotion;
use crate::results::ResultSet;
use crate::settings::{Estimator, Settings};
use stonewise_core::evaluate::MotionScore;
use stonewise_core::matching::MatchParams;

/// How the stones are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    /// The method with the settings of the project.
    Ours,
    /// The paper's matching and its estimator.
    Paper,
}

impl Method {
    pub(super) const ALL: [Self; 2] = [Self::Ours, Self::Paper];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Ours => "stonewise",
            Self::Paper => "the paper's estimator",
        }
    }

    pub(super) fn folder(self) -> &'static str {
        match self {
            Self::Ours => "stonewise",
            Self::Paper => "paper",
        }
    }

    pub(super) fn settings(self, settings: &Settings) -> Settings {
        let mut settings = settings.clone();
        if self == Self::Paper {
            settings.r#match = MatchParams::paper();
            settings.registration.estimator = Estimator::Gicp;
        }
        settings
    }
}

/// One run: a survey, a motion, a method.
pub(super) struct Case {
    pub survey: String,
    pub motion: KnownMotion,
    pub method: Method,
    pub settings: Settings,
    pub results: ResultSet,
    /// Scores of the stones and of M3C2 at its core points.
    pub all: [MotionScore; 2],
    /// The same in the place that moves, where only a part does.
    pub inside: Option<[MotionScore; 2]>,
}

/// A name as a file or folder: letters, digits, dashes.
pub(super) fn file_name(name: &str) -> String {
    let plain = |c: char| {
        if c.is_alphanumeric() {
            c.to_ascii_lowercase()
        } else {
            '-'
        }
    };
    name.chars().map(plain).collect()
}
