//! What photos show of the stones' motions.

mod bias;
mod evidence;
mod model;
mod poses;
mod stone_photos;
mod stone_turn;

#[cfg(test)]
pub(crate) use bias::BiasWeights;
pub use evidence::{FaceShift, PhotoShift, StoneEvidence};
pub(crate) use model::{PhotoModel, StoneInPhotos};
pub use model::{PhotoReport, StonePhotoReport};
pub(crate) use poses::CloudMotion;
#[cfg(test)]
pub(crate) use poses::PoseInfluence;
pub(crate) use stone_photos::StonePhotos;
