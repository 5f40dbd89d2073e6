//! What a person corrects.

use nalgebra::Point2;
use serde::{Deserialize, Serialize};

/// What a person corrects; places are (along, up) on the unrolled wall, metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LabelEdit {
    /// The stones at these places are one.
    Merge(Vec<Point2<f64>>),
    /// Stones that lie inside this outline by more than half of their points are one.
    MergeInside(Vec<Point2<f64>>),
    /// Stones that this line crosses from border to border are two.
    Split(Vec<Point2<f64>>),
    /// What lies inside this outline is a stone of its own, apart from the stone that it is a part of.
    CutOut(Vec<Point2<f64>>),
    /// At these places there is no stone.
    Delete(Vec<Point2<f64>>),
    /// Stones that lie inside this outline by more than half of their points are none.
    DeleteInside(Vec<Point2<f64>>),
    /// What no stone has inside this outline is a stone.
    Add(Vec<Point2<f64>>),
    /// Inside this outline there are no stones; a stone that reaches into it ends at the outline.
    Ignore(Vec<Point2<f64>>),
}
