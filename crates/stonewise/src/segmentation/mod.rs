//! Stones of photos by themselves, without clouds and cameras.

mod folder;
mod overlay;

use crate::address_space;
use crate::error::Result;
pub use folder::{FolderJob, FolderSummary, MaskEvaluation, PhotoScore, segment_folder};
pub use overlay::outlined;

/// Memory of the search for stones with one tile at a time is 0.25 GB, with two 0.41 GB
/// (docs/src/performance.md): the part that does not depend on the threads.
const DETECTOR_BASE: u64 = 90 << 20;
const DETECTOR_PER_THREAD: u64 = 165 << 20;

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
