//! Corrections of labels by hand: stones that a person merges, splits, deletes or adds, and areas that are
//! ignored.
//!
//! Edits work on the labelled cloud, after the vote of the photos, in the frame of the unrolled wall (along,
//! up): the same shapes apply to every epoch, whatever its photos and instances are, and points that no edit
//! touches keep their stone. Edits are applied one after the other, each to what the earlier ones left.

mod apply;
mod edit_labels;
mod edited_wall;
mod effect;
mod label_edit;
mod line;
#[cfg(test)]
mod tests;
mod touched;

pub use edit_labels::{EditReport, edit_labels};
pub use edited_wall::EditedWall;
pub use effect::{EditEffect, NoEffect};
pub use label_edit::LabelEdit;
