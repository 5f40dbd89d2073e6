//! Stones of photos by themselves, without clouds and cameras.

mod folder;
mod overlay;

use crate::address_space;
use crate::error::Result;
pub use folder::{FolderJob, FolderSummary, MaskEvaluation, PhotoScore, segment_folder};
pub use overlay::outlined;

/// Address space that the search for stones takes beyond the program and its threads, which is more than the
/// memory it uses: 0.40 GB with one thread, 0.51 with two, 0.97 with four (docs/src/performance.md), rounded
/// up, and 0.16 GB for the weights transformed for use.
const DETECTOR_BASE: u64 = 400 << 20;
const DETECTOR_PER_THREAD: u64 = 190 << 20;

/// Memory that the search for stones takes with the threads of now, bytes.
pub(crate) fn detector_memory() -> u64 {
    DETECTOR_BASE + DETECTOR_PER_THREAD * rayon::current_num_threads() as u64
}

/// Compares the limit on the address space with what [`segment_folder`] takes.
///
/// # Errors
/// The limit is too low: the search would end in the middle.
pub fn require_memory() -> Result<()> {
    address_space::require(detector_memory(), "the search for stones in photos")
}
