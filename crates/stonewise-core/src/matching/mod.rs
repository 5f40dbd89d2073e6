//! Which stone of the second epoch is which stone of the first.
//!
//! A common shift is found first by a vote over centroid differences, so that motions larger than a stone
//! still match; then a smooth field of local shifts follows settlements and bulges. Distances in the ratio
//! test are what remains.

mod align;
mod centroids;
mod constellation;
mod face_patch;
mod field;
mod footprints;
mod match_stones;
mod offset;
mod params;
mod shift;
mod tracks;

pub use align::{AlignError, Alignment, align_stones};
pub use face_patch::{FaceGrid, FacePatch};
pub use footprints::{Footprints, footprint_overlap};
pub use match_stones::{MatchQuality, MatchReport, Overlap, Surroundings, match_stones};
pub use offset::{Offset, OffsetVote};
pub use params::MatchParams;
pub use tracks::{LaterStones, Track, tracks};
