//! The motion of every matched stone, from its points in both epochs.
//!
//! [`adjust`] is the default: all stones together, as surveyors adjust a network. [`align`] is the paper's
//! way: every stone by itself, with its surroundings.

pub(crate) mod adjustment;
mod bulges;
mod deformation;
mod gicp;
mod least_deviance;
mod modes;
pub mod observers;
mod octave_patches;
pub mod photos;
pub(crate) mod points;
mod random;

pub use adjustment::{
    AdjustError, AdjustmentParams, AdjustmentReport, Break, DrawnMotion, FaceShift, JointMotions,
    PhotoReport, PhotoShift, StoneEvidence, StonePhotoReport, VarianceComponents, adjust, adjust_with_photos,
    draw_motions,
};
pub use deformation::{
    Against, Deformation, DeformationZone, StoneDeformation, ZONE_EXTENTS_M, ZoneKind, deformation,
};
pub use gicp::{GicpBlock, GicpParams, GicpStone, align, relate_to_neighbours};
pub use points::{
    MatchedPair, MemoryPairs, NearPoint, PairPlaces, PairPoints, PairSource, StoneExtents, StonePoints,
    Window, choose_points, local_shifts, stone_points,
};
