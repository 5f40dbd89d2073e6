//! Stones that one epoch shows and the detector missed, divided or merged in another, labelled there by their place.
//!
//! A stone that is still where its neighbours say it must be has the same surface there. Its outline, moved
//! with its neighbours, then says which points of the other epoch are its own.

mod carry_labels;
mod params;
mod parts;
mod photos_facing;
mod stone_shape;
#[cfg(test)]
mod tests;

pub use carry_labels::{CarriedStone, CarryReport, NotCarried, PlacedShape, Sought, carry_labels};
pub use params::CarryParams;
pub use parts::{JoinReport, Joined, Shown, Whole, join_parts};
pub use photos_facing::photos_facing;
pub use stone_shape::{StoneShape, stone_shapes};
