//! Photos of any size, looked at in overlapping tiles at more than one scale, without seams.
//!
//! Every tile of every scale is given to the detector by itself. What it finds becomes a candidate, a mask in
//! the photo's own pixels. Most stones are candidates several times over: in two tiles that overlap, at two
//! scales. Of these, of parts of stones and of groups of stones the better explanation is chosen (`choice`),
//! and what is left is laid on the photo from best to worst (`merge`).

mod candidate;
mod choice;
mod grid;
mod merge;
mod options;
mod outline;
mod overlap;
mod pyramid;
mod segment;

pub use options::TilingOptions;
pub use outline::outline_boxes;
pub(crate) use pyramid::at_scale;
pub use segment::{TilingError, segment_photo};

#[cfg(test)]
mod tests;
