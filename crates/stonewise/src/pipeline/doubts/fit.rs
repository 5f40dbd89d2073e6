//! Whether photos find the stones where clouds and cameras put them: that distinguishes a misfit of cameras and clouds
//! from other causes of a doubt.

use crate::pipeline::steps::register::Registered;
use crate::results::records::EstimatorRecord;
use crate::texts::{CAUSE_FIT, CAUSE_NOT_FIT, CAUSE_OPEN, Said};
use stonewise_core::registration::photos::PhotoStatus;

/// Least number of stones whose share is not left to chance.
const LEAST_STONES: usize = 8;
/// Share of the stones from which on cameras and clouds fit: photos that lie more than some pixels beside the
/// face agree with no other photo, and so with hardly any stone.
const FITS: f64 = 0.5;

/// In how many stones that enough photos show do these agree with each other and between the epochs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Fit {
    found: usize,
    sought: usize,
}

impl Fit {
    pub fn of(registered: &Registered) -> Self {
        let EstimatorRecord::Adjustment(adjustment) = &registered.estimator else {
            return Self::default();
        };
        let Some(photos) = &adjustment.photos else {
            return Self::default();
        };
        let count = |status: &PhotoStatus| photos.statuses.get(status).copied().unwrap_or(0);
        let missed = [
            PhotoStatus::NoTemplate,
            PhotoStatus::NotFound,
            PhotoStatus::Ambiguous,
        ];
        let found = count(&PhotoStatus::Tracked);
        Self {
            found,
            sought: found + missed.iter().map(count).sum::<usize>(),
        }
    }

    /// Whether cameras and clouds fit each other; `None` where too few stones were sought.
    pub fn holds(self) -> Option<bool> {
        (self.sought >= LEAST_STONES).then_some(self.found as f64 >= FITS * self.sought as f64)
    }

    /// The cause of a doubt that this favours, in words.
    pub fn cause(self) -> Said {
        let message = match self.holds() {
            Some(true) => &CAUSE_FIT,
            Some(false) => &CAUSE_NOT_FIT,
            None => &CAUSE_OPEN,
        };
        message.say(&self.values())
    }

    /// Both numbers by their names in messages.
    pub fn values(self) -> [(&'static str, Said); 2] {
        [("found", self.found), ("sought", self.sought)].map(|(name, n)| (name, n.to_string().into()))
    }

    /// The fit of numbers that a test chooses.
    #[cfg(test)]
    pub const fn of_counts(found: usize, sought: usize) -> Self {
        Self { found, sought }
    }
}
