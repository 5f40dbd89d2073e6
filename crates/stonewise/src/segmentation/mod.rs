//! Stones of photos by themselves, without clouds and cameras.

mod folder;
mod overlay;
mod training;

use crate::address_space;
use crate::error::Result;
pub use folder::{FolderJob, FolderSummary, MaskEvaluation, PhotoScore, segment_folder};
pub use overlay::outlined;
pub(crate) use training::train_for;

/// Compares the limit on the address space with what [`segment_folder`] takes.
///
/// # Errors
/// The limit is too low: the search would end in the middle.
pub fn require_memory() -> Result<()> {
    address_space::require(
        address_space::detector_memory(),
        "the search for stones in photos",
    )
}
