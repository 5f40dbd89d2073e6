//! What was decided about merged, split and dropped instances, for people to check.

use crate::id::{ImageId, InstanceId, StoneId};
use serde::{Deserialize, Serialize};

/// A decision of the majority against a photo, or against a stone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum AuditEvent {
    /// A photo shows several stones as one instance; at each point it votes for the stone that others see
    /// there.
    SplitInstance {
        /// The photo.
        photo: ImageId,
        /// The instance that merges them.
        instance: InstanceId,
        /// The stones it covers, ascending; numbers of stones that were dropped later may occur.
        stones: Vec<StoneId>,
    },
    /// A photo shows a part of a stone as an instance of its own; it was joined to the stone.
    JoinedFragment {
        /// The photo.
        photo: ImageId,
        /// The fragment.
        instance: InstanceId,
        /// The stone it belongs to.
        stone: StoneId,
        /// Share of the fragment's area that the stone wins.
        share: f64,
    },
    /// An instance that most photos show as background.
    OutvotedInstance {
        /// The photo.
        photo: ImageId,
        /// The instance.
        instance: InstanceId,
        /// Share of its area that it wins.
        share: f64,
    },
    /// Stones that another epoch shows as one stone became one.
    JoinedParts {
        /// They, the one whose number the new stone has first.
        stones: Vec<StoneId>,
    },
    /// A stone that another epoch shows as several stones was divided into them.
    DividedStone {
        /// Its number, which no stone has any more.
        stone: StoneId,
    },
    /// Points far from the main body of a stone, or cut off from it, lost its label.
    DroppedIslands {
        /// The stone.
        stone: StoneId,
        /// Number of islands.
        islands: u32,
        /// Points on them.
        points: u64,
    },
    /// A stone with too few points.
    DroppedStone {
        /// The stone.
        stone: StoneId,
        /// Its points.
        points: u64,
        /// Photos that show it.
        photos: u32,
    },
}
