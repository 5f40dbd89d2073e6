//! Surveys and options of the experiment.

use crate::part::Part;
use crate::project::Project;
use std::path::PathBuf;

/// A survey of which one epoch is split, under the name of its scanner.
#[derive(Clone, Debug)]
pub struct PaperSurvey {
    /// `TLS`, `UAV`, or what the caller calls it.
    pub name: String,
    /// The survey; only one epoch of it is used.
    pub project: Project,
    /// Where the paper's estimator, which is slow, measures; everywhere where absent.
    pub paper_part: Option<Part>,
}

/// Options that hold for all surveys of the experiment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PaperOptions {
    /// The epoch that is split; the first where absent.
    pub epoch: Option<String>,
    /// Seed of the random division into halves.
    pub seed: u64,
    /// Minutes for which the project's detector is trained on nine tenths of each labelled photo; with 0 it
    /// is not trained. The detector finds the stones; masks are used only to train and to measure it. Where
    /// absent, the stones come from the masks.
    pub train_minutes: Option<f64>,
    /// A file of the regions in which the masks are complete, for training and measuring; everywhere where
    /// absent.
    pub valid: Option<PathBuf>,
}
