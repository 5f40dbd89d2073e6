//! From instances in photos to stones in the point cloud.
//!
//! Every point is projected into every photo that can see it; instances of different photos that cover the
//! same surface become one stone; the majority of the photos decides about each point. Four passes over the
//! cloud: surface, depth maps, overlaps of instances, labels. Memory holds a tile a thread, all depth maps
//! (bounded by a parameter), the masks as runs and the atoms, never the survey.
//!
//! Limits: a photo that looks at the back of a wall whose back is not in the cloud would see its front's
//! points; leave such photos without masks.

mod area;
mod assign;
mod atoms;
mod audit;
mod carry;
mod change_labels;
mod depth;
mod depth_bounds;
mod drop_stones;
mod each_tile;
mod edit;
mod error;
mod face;
mod frustum;
mod islands;
mod labels;
mod majority;
mod neighbourhood;
mod overlap;
mod panels;
mod params;
mod photo_frame;
mod photo_stones;
mod relief;
mod run_labels;
mod stones;
mod surface_cells;
mod tracks;
mod transfer_labels;
mod visibility;
mod visible;
mod vote;

pub use audit::AuditEvent;
pub use carry::{
    CarriedStone, CarryParams, CarryReport, JoinReport, Joined, NotCarried, PlacedShape, Shown, Sought,
    StoneShape, Whole, carry_labels, join_parts, photos_facing, stone_shapes,
};
pub use drop_stones::drop_stones;
pub use edit::{EditEffect, EditReport, EditedWall, LabelEdit, NoEffect, edit_labels};
pub use error::TransferError;
pub use labels::{LabelStore, MemoryLabels, TileLabels};
pub use panels::{StoneReliefs, panels};
pub use params::TransferParams;
pub use photo_stones::{PhotoStones, photo_stones};
pub use relief::photo_relief;
pub use stones::{StoneParams, build_stones};
pub use transfer_labels::{PhotoVotes, StoneInstances, Transfer, transfer_labels};
