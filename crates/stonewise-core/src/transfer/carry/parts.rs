//! Stones of one epoch that are parts of a stone of another.

use super::super::change_labels::change_labels;
use super::super::each_tile::each_tile;
use super::super::{LabelStore, TransferError};
use super::carry_labels::{LEAST_SHARE, PlacedShape, REACH_M};
use crate::cloud::TileSource;
use crate::id::StoneId;
use crate::progress::Progress;
use crate::stone::Stone;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Parts whose mean heights above the whole differ by more than this, metres, are not one stone: one of them
/// moved. Ten millimetres: two thirds of the typical motion of a loose stone, and more than masks and noise
/// shift the mean height of a part.
const LARGEST_STEP_M: f64 = 0.01;

/// How many photos of an epoch show a stone as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shown {
    /// Photos that show it.
    pub photos: u32,
    /// Photos that face its place and do not show it.
    pub missed: u32,
}

/// A stone that may be in parts in another epoch.
#[derive(Clone, Copy, Debug)]
pub struct Whole<'a> {
    /// Where the other epoch should have it.
    pub placed: PlacedShape<'a>,
    /// By the photos of its epoch.
    pub shown: Shown,
}

/// A stone made of parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Joined {
    /// The one with most points on the face first: the stone has its number.
    pub parts: Vec<StoneId>,
    /// By the photos of the epoch that shows it as a whole.
    pub shown: Shown,
}

/// What was joined in an epoch.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JoinReport {
    /// The new stones.
    pub joined: Vec<Joined>,
    /// Tiles whose labels differ now.
    pub tiles: BTreeSet<usize>,
}

/// Joins stones of an epoch that are parts of one stone of another epoch; labels of tiles that change go to
/// `target`.
///
/// A stone is a part if most of its points lie on the face of the whole. Two or more parts are joined if the
/// whole is shown by more photos than any of them, the photos of its epoch that do not show it counted
/// against it with `missed_weight`, and if their mean heights above the whole agree.
/// A whole that claims a part of an earlier whole joins nothing. `stones`: those of the epoch.
///
/// Cost: one pass over the tiles and one over those that change.
///
/// # Errors
/// A tile or its labels cannot be read or written, interruption.
pub fn join_parts<T: TileSource, S: LabelStore>(
    tiles: &T,
    labels: &S,
    target: &mut S,
    wholes: &[Whole],
    stones: &[Stone],
    missed_weight: f64,
    progress: &dyn Progress,
) -> Result<JoinReport, TransferError> {
    let on_faces = stones_on_faces(tiles, labels, wholes, progress)?;
    let stones: BTreeMap<StoneId, &Stone> = stones.iter().map(|s| (s.id, s)).collect();
    let mut numbers: BTreeMap<u32, u32> = BTreeMap::new();
    let mut joined = Vec::new();

    for (whole, on_face) in wholes.iter().zip(&on_faces) {
        let parts = parts(whole, on_face, &stones, missed_weight);
        let is_taken = parts.iter().any(|p| numbers.contains_key(&p.0));
        if let Some(main) = parts.first().filter(|_| !is_taken) {
            numbers.extend(parts.iter().map(|p| (p.0, main.0)));
            joined.push(Joined {
                parts,
                shown: whole.shown,
            });
        }
    }

    let every = 0..tiles.tile_count();
    let progress = ("labels of joined stones", progress);
    let changed = change_labels(labels, target, every, progress, |_, table| {
        let mut is_changed = false;
        for stone in &mut table.stone {
            if let Some(&number) = numbers.get(stone) {
                is_changed |= number != *stone;
                *stone = number;
            }
        }
        is_changed
    })?;

    Ok(JoinReport {
        joined,
        tiles: changed,
    })
}

/// The points of a stone on the face of another.
#[derive(Clone, Copy, Default)]
struct OnFace {
    points: u64,
    /// Sum of their heights above it, metres.
    height_sum_m: f64,
}

/// The stones on the face of each whole.
fn stones_on_faces<T: TileSource, S: LabelStore>(
    tiles: &T,
    labels: &S,
    wholes: &[Whole],
    progress: &dyn Progress,
) -> Result<Vec<BTreeMap<StoneId, OnFace>>, TransferError> {
    let mut on_faces = vec![BTreeMap::<StoneId, OnFace>::new(); wholes.len()];
    each_tile(
        tiles,
        labels,
        "parts of stones",
        progress,
        |tile, cloud, labels| {
            let bounds = tiles.bounds(tile);
            for (whole, on_face) in wholes.iter().zip(&mut on_faces) {
                let PlacedShape { shape, shift } = whole.placed;
                let reach = shape.bounds().moved(&shift).grown(REACH_M);
                if !reach.intersects(&bounds) {
                    continue;
                }
                for (i, &stone) in labels.stone.iter().enumerate().filter(|(_, s)| **s != 0) {
                    let world = cloud.world(i);
                    if !reach.contains(&world) {
                        continue;
                    }
                    let place = shape.place(&(world - shift));
                    if let Some(place) = place.filter(|p| p.height_m.abs() <= REACH_M) {
                        let on = on_face.entry(StoneId(stone)).or_default();
                        on.points += 1;
                        on.height_sum_m += place.height_m;
                    }
                }
            }
        },
    )?;

    Ok(on_faces)
}

/// The parts of a whole, the one with most points first; empty where it has none, or where they stay apart.
fn parts(
    whole: &Whole,
    on_face: &BTreeMap<StoneId, OnFace>,
    stones: &BTreeMap<StoneId, &Stone>,
    missed_weight: f64,
) -> Vec<StoneId> {
    let is_part = |(id, on): &(&StoneId, &OnFace)| {
        let all = stones.get(id).map_or(f64::INFINITY, |s| f64::from(s.points));
        on.points as f64 >= LEAST_SHARE * all
    };
    let mut parts: Vec<(&StoneId, &OnFace)> = on_face.iter().filter(is_part).collect();
    parts.sort_by(|(a, on_a), (b, on_b)| on_b.points.cmp(&on_a.points).then(a.cmp(b)));
    let heights = parts.iter().map(|(_, on)| on.height_sum_m / on.points as f64);
    let [low, high] = heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], h| {
        [low.min(h), high.max(h)]
    });
    let most = parts
        .iter()
        .filter_map(|(id, _)| stones.get(id))
        .map(|s| s.photos);
    let against = f64::from(most.max().unwrap_or(0)) + missed_weight * f64::from(whole.shown.missed);
    let is_one = parts.len() >= 2 && high - low <= LARGEST_STEP_M && f64::from(whole.shown.photos) > against;
    match is_one {
        true => parts.iter().map(|(id, _)| **id).collect(),
        false => Vec::new(),
    }
}
