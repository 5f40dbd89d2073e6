//! The joint adjustment of all stones.
//!
//! [`adjust`] reads as the method. Its phases are in `phases`, and the order of an iteration (evaluate, solve,
//! step) in `iteration`: each hands a type to the next, so that none can be called out of order. What the
//! stones' points say comes from `observation`, the motion that neighbours share from `field`, and whether a
//! stone moved with it or on its own from `hypothesis`; `state` is what changes between iterations.

mod adjust;
mod bodies;
mod breaks;
mod candidate;
mod covered;
mod draw;
mod equations;
mod error;
mod estimate;
mod evaluate;
mod field;
mod hypothesis;
mod iteration;
mod joins;
mod joint;
pub(crate) mod joint_motions;
mod neighbour_covariances;
pub(crate) mod observation;
mod octaves;
mod outcome;
mod params;
mod partial_view;
mod phases;
mod significance;
mod solution;
mod state;
mod step;
pub(crate) mod stone_vector;
mod surroundings;
mod survey;
#[cfg(test)]
pub(super) mod testing;
mod tracking;

pub use adjust::{adjust, adjust_with_photos};
pub use draw::{DrawnMotion, draw_motions};
pub use error::AdjustError;
pub use field::VarianceComponents;
pub use joint_motions::JointMotions;
pub use observation::photo::{FaceShift, PhotoReport, PhotoShift, StoneEvidence, StonePhotoReport};
pub use params::{AdjustmentParams, AdjustmentReport, Break};
