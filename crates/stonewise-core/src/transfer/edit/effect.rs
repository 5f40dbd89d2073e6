//! What an edit did, or why it did nothing.

use nalgebra::Point2;
use serde::{Deserialize, Serialize};

/// What an edit did in one epoch.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EditEffect {
    /// Stones that it changed, as they were numbered before it, ascending.
    pub before: Vec<u32>,
    /// Stones that it made or changed, ascending; those that are gone are not among them.
    pub after: Vec<u32>,
    /// Points that belong to another stone now, or to none.
    pub points: u64,
}

/// Why an edit did nothing in an epoch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
pub enum NoEffect {
    /// No stone lies at any of its places.
    #[error("no stone at ({:.2}, {:.2}) m", .at.x, .at.y)]
    NoStone {
        /// The first of its places.
        at: Point2<f64>,
    },
    /// All its places, or its outline, hold one stone only.
    #[error("it names one stone only, {stone}")]
    OneStone {
        /// The stone.
        stone: u32,
    },
    /// The line crosses no stone from border to border.
    #[error("the line crosses no stone from border to border")]
    NotCrossed,
    /// A part of a stone would have too few points.
    #[error("a part of stone {stone} would have too few points: {points}, {needed} are needed")]
    SmallPart {
        /// The stone.
        stone: u32,
        /// Points of the smaller part.
        points: u64,
        /// Points needed.
        needed: u32,
    },
    /// There are too few points inside the outline that belong to no stone.
    #[error("too few points inside the outline belong to no stone: {points}, {needed} are needed")]
    FewPoints {
        /// Points inside.
        points: u64,
        /// Points needed.
        needed: u32,
    },
    /// Nothing inside the outline belongs to a stone.
    #[error("no stone lies inside the outline")]
    NothingInside,
    /// The photo's pixels could not be brought onto the wall.
    #[error("{0}")]
    NoPlace(String),
}
