//! Photos whose stones are known, wherever they come from.

use super::error::DatasetError;
use crate::Sample;
use std::collections::BTreeSet;

/// Photos with their stones, to learn from and to measure on.
pub trait PhotoSet: Sync {
    /// How many there are.
    fn count(&self) -> usize;

    /// One of them with its stones, counted from 0.
    ///
    /// # Errors
    /// The photo or its masks cannot be read.
    fn sample(&self, index: usize) -> Result<Sample, DatasetError>;

    /// The stones of a photo that are kept for measuring, by their labels; `None`: those of some blocks of the
    /// photo, chosen by chance.
    fn kept_stones(&self, _index: usize) -> Option<BTreeSet<u32>> {
        None
    }
}
