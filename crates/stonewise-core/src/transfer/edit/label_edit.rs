//! What a person corrects.

use nalgebra::Point2;
use serde::{Deserialize, Serialize};

/// What a person corrects; places are (along, up) on the unrolled wall, metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LabelEdit {
    /// Merges the stones at these places into one.
    Merge(Vec<Point2<f64>>),
    /// Merges the stones of which more than half of the points lie inside this outline into one.
    MergeInside(Vec<Point2<f64>>),
    /// Splits each stone in two that this line crosses from border to border.
    Split(Vec<Point2<f64>>),
    /// Makes what lies inside this outline a stone of its own, apart from the stone that it is a part of.
    CutOut(Vec<Point2<f64>>),
    /// Deletes the stones at these places.
    Delete(Vec<Point2<f64>>),
    /// Deletes the stones of which more than half of the points lie inside this outline.
    DeleteInside(Vec<Point2<f64>>),
    /// Adds a stone: the points inside this outline that belong to no stone.
    Add(Vec<Point2<f64>>),
    /// Removes all stones from inside this outline; a stone that reaches into it ends at the outline.
    Ignore(Vec<Point2<f64>>),
}
