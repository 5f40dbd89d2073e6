//! Stones of photos by themselves, without clouds and cameras.

mod folder;
mod overlay;

pub use folder::{FolderJob, FolderSummary, MaskEvaluation, PhotoScore, segment_folder};
pub use overlay::outlined;
