//! The points of another epoch that belong to a stone.

use super::super::change_labels::change_labels;
use super::super::each_tile::each_tile;
use super::super::{LabelStore, TransferError};
use super::params::CarryParams;
use super::stone_shape::{Cell, FacePlace, StoneShape};
use crate::cloud::TileSource;
use crate::geometry::CellMap;
use crate::id::StoneId;
use crate::params::Params;
use crate::progress::Progress;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Points farther from a stone's surface than this are another object, or the back of the wall, metres. 0.15:
/// where the transfer takes a step in depth for the silhouette of another object.
pub(super) const REACH_M: f64 = 0.15;
/// A point belongs to a surface within this many times the spread of the surface's own points. 3: nearly all
/// of them.
const SPREADS: f64 = 3.0;
/// Cells of a face, at least. 9: three by three; of smaller faces, parts that reach out of the ground or from
/// behind a plant, many places on a wall look alike.
const LEAST_CELLS: usize = 9;
/// Least share of a part that lies on the whole, and of the points of the whole that its parts hold: not all, because
/// outlines differ from epoch to epoch, but enough that a neighbour that overlaps the whole is no part, and that no
/// large piece of the whole is left over.
pub(super) const LEAST_SHARE: f64 = 0.6;

/// A stone where another epoch should have it.
#[derive(Clone, Copy, Debug)]
pub struct PlacedShape<'a> {
    /// Its face, as the epoch that shows it has it.
    pub shape: &'a StoneShape,
    /// How its surroundings moved from that epoch to the other, metres.
    pub shift: Vector3<f64>,
}

/// Stones that are looked for in an epoch.
#[derive(Clone, Copy, Debug)]
pub struct Sought<'a> {
    /// Where the epoch should have them.
    pub stones: &'a [PlacedShape<'a>],
    /// Stones of the epoch that may be several, merged by the detector, with the numbers of their points: those without
    /// a partner, or with one that may be a part of them.
    pub maybe_merged: &'a BTreeMap<StoneId, u64>,
    /// Number of the first stone that is carried.
    pub first_new: u32,
    /// Least number of points of a stone.
    pub min_points: u32,
}

/// A stone that was carried into an epoch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CarriedStone {
    /// Its number there.
    pub stone: u32,
    /// Its points there.
    pub points: u64,
    /// Share of its cells in which that epoch has points.
    pub covered_share: f64,
    /// Share of these cells in which the surface is the same, and no other stone's.
    pub same_share: f64,
}

/// Why a stone was not carried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
pub enum NotCarried {
    /// Its points cover no area.
    #[error("its points cover no area")]
    NoShape,
    /// Its face is too small to be distinguished from other places.
    #[error("its face has too few cells of 3 cm: {cells}, {needed} are needed")]
    Small {
        /// Its cells.
        cells: usize,
        /// Cells needed.
        needed: usize,
    },
    /// The photos that show it do not outweigh those of both epochs that face its place and do not show it.
    #[error("{}, {}", shown_by(*.photos), missed_by(*.missed))]
    Outvoted {
        /// Photos that show it.
        photos: u32,
        /// Photos of both epochs that face its place and do not show it.
        missed: u32,
    },
    /// The other epoch has too few points at its place.
    #[error("points cover {:.0} % of its place", 100.0 * .share)]
    NotCovered {
        /// Share of its cells in which the epoch has points.
        share: f64,
    },
    /// Another surface, or other stones, are at its place.
    #[error("the surface is the same and free in {:.0} % of its place", 100.0 * .share)]
    Different {
        /// Share of the covered cells in which the surface is the same, and no other stone's.
        share: f64,
    },
    /// Too few points.
    #[error("too few points: {points}, {needed} are needed")]
    FewPoints {
        /// Points.
        points: u64,
        /// Points needed.
        needed: u32,
    },
}

fn shown_by(photos: u32) -> String {
    match photos {
        1 => "1 photo shows it".to_owned(),
        n => format!("{n} photos show it"),
    }
}

fn missed_by(photos: u32) -> String {
    match photos {
        1 => "1 that faces its place does not".to_owned(),
        n => format!("{n} that face its place do not"),
    }
}

/// What became of stones that were to be carried into an epoch.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CarryReport {
    /// One for each stone, in order.
    pub outcomes: Vec<Result<CarriedStone, NotCarried>>,
    /// Stones of the epoch that were divided into carried ones and no longer exist.
    pub divided: BTreeSet<StoneId>,
    /// Tiles whose labels differ now.
    pub tiles: BTreeSet<usize>,
}

/// Labels the points of an epoch that belong to stones of another one; labels of tiles that change go to
/// `target`.
///
/// A stone is carried if the epoch has points in most cells of its face, and if in most of these cells they
/// form the same surface and belong to no other stone. Its points are those without a stone inside its
/// outline and near its surface; they get confidence 0, because no photo of the epoch voted for it. Where two
/// stones claim a point, the first has it. Carried stones are numbered from `first_new` on, in order; each
/// has at least `min_points` points.
///
/// A stone of `sought.maybe_merged` is divided if two or more of the stones that are looked for lie on it, hold most
/// of its points and can be carried if they take them. Points that none of them takes belong to no stone.
///
/// Cost: one pass over the tiles, and one over those that change (over all tiles if a stone is divided); memory holds
/// the points near the stones.
///
/// # Errors
/// A tile or its labels cannot be read or written, interruption.
pub fn carry_labels<T: TileSource, S: LabelStore>(
    tiles: &T,
    labels: &S,
    target: &mut S,
    sought: &Sought,
    params: &CarryParams,
    progress: &dyn Progress,
) -> Result<CarryReport, TransferError> {
    params.check()?;
    let stones = sought.stones;
    let mut near: Vec<Vec<Near>> = vec![Vec::new(); stones.len()];
    each_tile(
        tiles,
        labels,
        "stones of another epoch",
        progress,
        |tile, cloud, labels| {
            let bounds = tiles.bounds(tile);
            for (stone, near) in stones.iter().zip(&mut near) {
                let reach = stone.shape.bounds().moved(&stone.shift).grown(REACH_M);
                if !reach.intersects(&bounds) {
                    continue;
                }
                for (i, &other) in labels.stone.iter().enumerate() {
                    let world = cloud.world(i);
                    if !reach.contains(&world) {
                        continue;
                    }
                    let place = stone.shape.place(&(world - stone.shift));
                    if let Some(place) = place.filter(|p| p.height_m.abs() <= REACH_M) {
                        near.push(Near {
                            point: (tile as u32, i as u32),
                            place,
                            stone: StoneId(other),
                        });
                    }
                }
            }
        },
    )?;

    let mut wholes = wholes(sought, &near, params);
    let (outcomes, claims) = loop {
        let (outcomes, claims) = judge_all(sought, &near, &wholes, params);
        let is_carried = |part: &&usize| outcomes.get(**part).is_some_and(Result::is_ok);
        let before = wholes.len();
        wholes.retain(|_, parts| parts.iter().filter(is_carried).count() >= 2);
        if wholes.len() == before {
            break (outcomes, claims);
        }
    };
    let divided: BTreeSet<StoneId> = wholes.into_keys().collect();

    let is_touched = |tile: &usize| !divided.is_empty() || claims.contains_key(tile);
    let touched = (0..tiles.tile_count()).filter(is_touched);
    let progress = ("labels of carried stones", progress);
    let changed = change_labels(labels, target, touched, progress, |tile, table| {
        let mut is_changed = false;
        for stone in table.stone.iter_mut().filter(|s| divided.contains(&StoneId(**s))) {
            *stone = NO_STONE.0;
            is_changed = true;
        }
        for (&i, &stone) in claims.get(&tile).into_iter().flatten() {
            table.stone[i as usize] = stone;
            table.confidence[i as usize] = 0.0;
            is_changed = true;
        }
        is_changed
    })?;

    Ok(CarryReport {
        outcomes,
        divided,
        tiles: changed,
    })
}

/// Which stones claim points, by tile and place in it.
type Claims = BTreeMap<usize, BTreeMap<u32, u32>>;

/// What becomes of the stones that are looked for if these wholes are divided.
fn judge_all(
    sought: &Sought,
    near: &[Vec<Near>],
    wholes: &BTreeMap<StoneId, BTreeSet<usize>>,
    params: &CarryParams,
) -> (Vec<Result<CarriedStone, NotCarried>>, Claims) {
    let (mut outcomes, mut claims) = (Vec::new(), Claims::new());
    let mut next = sought.first_new;

    for (k, (stone, near)) in sought.stones.iter().zip(near).enumerate() {
        let is_free = |n: &Near| {
            let (tile, index) = n.point;
            let is_claimed = { claims.get(&(tile as usize)) }.is_some_and(|c| c.contains_key(&index));
            let is_own_whole = || wholes.get(&n.stone).is_some_and(|parts| parts.contains(&k));
            !is_claimed && (n.stone == NO_STONE || is_own_whole())
        };
        let outcome = judge(stone.shape, near, is_free, [next, sought.min_points], params);
        if outcome.is_ok() {
            let tolerance_m = tolerance_m(stone.shape, params);
            let own = near.iter().filter(|n| n.is_on_surface(tolerance_m) && is_free(n));
            let own: Vec<(u32, u32)> = own.map(|n| n.point).collect();
            for (tile, index) in own {
                claims.entry(tile as usize).or_default().insert(index, next);
            }
            next += 1;
        }
        outcomes.push(outcome);
    }

    (outcomes, claims)
}

/// What a part holds of a whole.
#[derive(Default)]
struct OnWhole {
    /// Cells of the part.
    cells: BTreeSet<Cell>,
    /// Points of the whole, by tile and place in it.
    points: BTreeSet<(u32, u32)>,
}

/// The stones of `sought.maybe_merged` that consist of two or more of the stones that are looked for, with the places
/// of these in `sought.stones`.
fn wholes(sought: &Sought, near: &[Vec<Near>], params: &CarryParams) -> BTreeMap<StoneId, BTreeSet<usize>> {
    let mut parts: BTreeMap<StoneId, BTreeSet<usize>> = BTreeMap::new();
    let mut held: BTreeMap<StoneId, BTreeSet<(u32, u32)>> = BTreeMap::new();
    for (k, (stone, near)) in sought.stones.iter().zip(near).enumerate() {
        if stone.shape.cell_count() < LEAST_CELLS {
            continue;
        }
        let tolerance_m = tolerance_m(stone.shape, params);
        let mut on: BTreeMap<StoneId, OnWhole> = BTreeMap::new();
        let mut covered = BTreeSet::new();
        for n in near.iter().filter(|n| n.is_on_surface(tolerance_m)) {
            covered.insert(n.place.cell);
            if sought.maybe_merged.contains_key(&n.stone) {
                let on = on.entry(n.stone).or_default();
                on.cells.insert(n.place.cell);
                on.points.insert(n.point);
            }
        }
        for (whole, OnWhole { cells, points }) in on {
            let held = held.entry(whole).or_default();
            // Two epochs may show the same part.
            let is_new = 2 * points.difference(held).count() > points.len();
            if is_new && cells.len() as f64 >= LEAST_SHARE * covered.len() as f64 {
                held.extend(points);
                parts.entry(whole).or_default().insert(k);
            }
        }
    }
    parts.retain(|whole, parts| {
        let all = sought.maybe_merged.get(whole).copied().unwrap_or(u64::MAX);
        let held = held.get(whole).map_or(0, BTreeSet::len);
        parts.len() >= 2 && held as f64 >= LEAST_SHARE * all as f64
    });
    parts
}

/// The number of points without a stone.
const NO_STONE: StoneId = StoneId(0);

/// A point near the face of a stone.
#[derive(Clone, Copy)]
struct Near {
    /// Tile, and place in it.
    point: (u32, u32),
    place: FacePlace,
    /// The stone that has it, or [`NO_STONE`].
    stone: StoneId,
}

impl Near {
    fn is_on_surface(&self, tolerance_m: f64) -> bool {
        self.place.height_m.abs() <= tolerance_m
    }
}

/// Distance from the surface within which a point belongs to the stone, metres.
fn tolerance_m(shape: &StoneShape, params: &CarryParams) -> f64 {
    params.max_height_m + SPREADS * shape.spread_m()
}

/// What a cell holds.
#[derive(Clone, Copy, Default)]
struct CellContent {
    /// Points on the stone's surface, and the sum of their heights above it.
    on_surface: usize,
    height_sum_m: f64,
    /// Points of other stones, and points behind the surface. What stands in front of it does not count.
    others: usize,
}

impl CellContent {
    fn is_same(&self, params: &CarryParams) -> bool {
        let mean = self.height_sum_m / self.on_surface as f64;
        self.on_surface > 0 && self.on_surface >= self.others && mean.abs() <= params.max_height_m
    }
}

/// Whether a stone is at its place; `near`: points there; `is_free`: whether the stone may have one of them.
fn judge(
    shape: &StoneShape,
    near: &[Near],
    is_free: impl Fn(&Near) -> bool,
    [number, min_points]: [u32; 2],
    params: &CarryParams,
) -> Result<CarriedStone, NotCarried> {
    if shape.cell_count() < LEAST_CELLS {
        return Err(NotCarried::Small {
            cells: shape.cell_count(),
            needed: LEAST_CELLS,
        });
    }

    let tolerance_m = tolerance_m(shape, params);
    let mut cells: CellMap<Cell, CellContent> = CellMap::default();
    let mut points = 0;

    for n in near {
        let is_free = is_free(n);
        let is_own = is_free && n.is_on_surface(tolerance_m);
        if is_free && !is_own && n.place.height_m > 0.0 {
            continue;
        }
        let content = cells.entry(n.place.cell).or_default();
        match is_own {
            true => {
                points += 1;
                content.on_surface += 1;
                content.height_sum_m += n.place.height_m;
            }
            false => content.others += 1,
        }
    }

    let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
    let covered_share = share(cells.len(), shape.cell_count());
    if covered_share < params.min_covered_share {
        return Err(NotCarried::NotCovered { share: covered_share });
    }
    let same = cells.values().filter(|c| c.is_same(params)).count();
    let same_share = share(same, cells.len());
    if same_share < params.min_same_share {
        return Err(NotCarried::Different { share: same_share });
    }

    if points < u64::from(min_points) {
        return Err(NotCarried::FewPoints {
            points,
            needed: min_points,
        });
    }

    Ok(CarriedStone {
        stone: number,
        points,
        covered_share,
        same_share,
    })
}
