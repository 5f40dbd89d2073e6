//! How well stones were found: masks against reference masks.
//!
//! A reference may be complete only in a part of its photo. A reference stone counts if most of it lies
//! there. A stone that was found and fits none of the reference stones that count is wrong, unless most of it
//! lies outside or it fits a stone that does not count: then nothing is known about it and it is left out.

mod average_precision;
mod mask_score;
mod pairs;

pub use mask_score::MaskScore;
pub use pairs::{FoundStone, PhotoPairs, pair_masks};
