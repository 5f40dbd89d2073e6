//! All edits, on the labels of an epoch.

use super::super::{LabelStore, TransferError};
use super::apply::apply;
use super::edited_wall::EditedWall;
use super::effect::{EditEffect, NoEffect};
use super::label_edit::LabelEdit;
use super::touched::Touched;
use crate::cloud::TileSource;
use crate::progress::Progress;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// What edits did to the labels of an epoch.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EditReport {
    /// What each edit did, in their order.
    pub effects: Vec<Result<EditEffect, NoEffect>>,
    /// The stones as labelled whose points each stone has that edits made or changed. Stones that are gone are not
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
/// A merged stone keeps the lowest number of its parts. Of a stone that is split the part with more points
/// keeps the number; others get new numbers from [`EditedWall::first_new`] on, in the order of the edits.
/// Points of an added stone have confidence 0: no photo voted for it.
///
/// Cost: two passes over the tiles and one over those that change; memory holds the points of the stones that
/// edits touch.
///
/// # Errors
/// A tile or its labels cannot be read or written, interruption.
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
