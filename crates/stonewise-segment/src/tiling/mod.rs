//! Photos of any size, looked at in overlapping tiles at more than one scale, without seams.
//!
//! Every tile of every scale is given to the detector by itself. What it finds becomes a candidate, a mask in the photo's own pixels. Most stones
//! are candidates several times over: in two tiles that overlap, at two scales. Candidates are laid on the photo from best to worst
//! ([`merge`]), and one that lies for the most part on better ones is the same stone again, or a part or a group of stones, and is dropped.

mod candidate;
mod grid;
mod merge;
mod options;
mod pyramid;
mod segment;

pub use options::TilingOptions;
pub(crate) use pyramid::at_scale;
pub use segment::{TilingError, segment_photo};

#[cfg(test)]
mod tests;
