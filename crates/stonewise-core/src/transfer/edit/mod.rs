//! Corrections of labels by hand: stones that a person merges, splits, deletes or adds, and areas that are ignored.
//!
//! Edits work on the labelled cloud, after the vote of the photos, in the frame of the unrolled wall (along, up): the
//! same shapes apply to every epoch, whatever its photos and instances are, and points that no edit touches keep
//! their stone. Edits are applied one after the other, each to what the earlier ones left.

mod apply;
mod effect;
mod line;
#[cfg(test)]
mod tests;
mod touched;

pub use effect::{EditEffect, NoEffect};

use super::{LabelStore, TransferError};
use crate::cloud::TileSource;
use crate::id::StoneId;
use crate::progress::Progress;
use apply::apply;
use nalgebra::{Point2, Point3};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use touched::Touched;

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

/// How a cloud lies on the wall on which edits are drawn.
pub struct EditedWall<'a> {
    /// (along, up, out) of a point, metres: its place on the unrolled wall, and how far it lies in front of any fixed plane
    /// that is roughly the wall's.
    pub place: &'a (dyn Fn(&Point3<f64>) -> Point3<f64> + Sync),
    /// Stones that belong to the side of the wall on which edits are drawn.
    pub stones: &'a BTreeSet<StoneId>,
    /// Parts of stones, and added stones, have at least so many points.
    pub min_points: u32,
    /// Number of the first new stone; above that of every stone.
    pub first_new: u32,
}

/// What edits did to the labels of an epoch.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EditReport {
    /// What each edit did, in their order.
    pub effects: Vec<Result<EditEffect, NoEffect>>,
    /// Of every stone that edits made or changed: the stones as labelled whose points it has. Stones that are gone are not
    /// among them.
    pub origins: BTreeMap<u32, BTreeSet<u32>>,
    /// Stones as labelled that are gone.
    pub gone: BTreeSet<u32>,
    /// The last edit that touched each stone that edits made or changed: its index in the list of edits.
    pub edited_by: BTreeMap<u32, usize>,
    /// Tiles whose labels differ now.
    pub tiles: BTreeSet<usize>,
}

/// Applies edits to the labels of a cloud; labels of tiles that change go to `target`.
///
/// A merged stone keeps the lowest number of its parts. Of a stone that is split the part with more points keeps the
/// number; others get new numbers from [`EditedWall::first_new`] on, in the order of the edits. Points of an added stone
/// have confidence 0: no photo voted for it.
///
/// Errors: a tile or its labels cannot be read or written, interruption. Cost: two passes over the tiles and one over those
/// that change; memory holds the points of the stones that edits touch.
pub fn edit_labels<T: TileSource, S: LabelStore>(
    tiles: &T,
    labels: &S,
    target: &mut S,
    wall: &EditedWall,
    edits: &[LabelEdit],
    progress: &dyn Progress,
) -> Result<EditReport, TransferError> {
    let mut touched = Touched::gather(tiles, labels, wall, edits, progress)?;
    let mut next = wall.first_new;
    let mut edited_by = BTreeMap::new();
    let mut effects = Vec::new();
    for (index, edit) in edits.iter().enumerate() {
        let effect = apply(&mut touched, edit, wall.min_points, &mut next);
        if let Ok(effect) = &effect {
            edited_by.extend(effect.after.iter().map(|&stone| (stone, index)));
        }
        effects.push(effect);
    }
    let origins = touched.origins();
    let gone = touched.gone(&origins);
    edited_by.retain(|stone, _| origins.contains_key(stone));
    let tiles_changed = touched.write(labels, target)?;
    Ok(EditReport {
        effects,
        origins,
        gone,
        edited_by,
        tiles: tiles_changed,
    })
}
