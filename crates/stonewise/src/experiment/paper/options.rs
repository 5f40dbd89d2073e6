//! What the experiment is made with.

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
    /// Where the paper's estimator measures, which takes seconds a stone; everywhere where absent.
    pub paper_part: Option<Part>,
}

/// What the experiment does beside its runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PaperOptions {
    /// The epoch that is split; the first where absent.
    pub epoch: Option<String>,
    /// Decides the halves.
    pub seed: u64,
    /// Minutes that a detector is trained on nine tenths of the labelled photos, 0 for the detector of the
    /// project as it is. It finds the stones, and the masks are only used to train and to measure it. Where
    /// absent, the masks themselves are the stones.
    pub train_minutes: Option<f64>,
    /// A file of the regions in which the masks are complete, for training and measuring; everywhere where
    /// absent.
    pub valid: Option<PathBuf>,
}
