//! The points that edits can touch.

use super::super::each_tile::each_tile;
use super::super::{LabelStore, TransferError};
use super::edited_wall::EditedWall;
use super::label_edit::LabelEdit;
use crate::cloud::TileSource;
use crate::id::StoneId;
use crate::progress::Progress;
use nalgebra::{Point2, Point3};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

/// A place belongs to the stone of the nearest point within this distance, metres. 0.05: half of a small
/// stone, more than the gaps between points.
const PLACE_REACH_M: f64 = 0.05;
/// Around an added stone, stones within this distance say where the face is, metres: the next course.
pub(super) const FACE_REACH_M: f64 = 0.5;
/// Edge of the cells in which the neighbourhood of edits is noted, metres. 0.5: about a stone, and few cells
/// for large areas.
const CELL_M: f64 = 0.5;

/// A point of the wall that edits can touch.
#[derive(Clone, Copy, Debug)]
pub(super) struct WallPoint {
    /// (along, up).
    pub place: Point2<f64>,
    /// Distance in front of a plane that is roughly the wall's.
    pub out_m: f64,
    /// Its stone now; 0 none.
    pub stone: u32,
    /// Whether an edit made it a point of a stone that it did not belong to.
    pub added: bool,
    labelled: u32,
    tile: u32,
    index: u32,
}

/// The points of all stones near edits, and of no stone near outlines that are added.
pub(super) struct Touched {
    pub points: Vec<WallPoint>,
    /// Indices of points by cells of [`PLACE_REACH_M`].
    cells: HashMap<[i64; 2], Vec<u32>>,
}

impl Touched {
    pub(super) fn gather<T: TileSource, S: LabelStore>(
        tiles: &T,
        labels: &S,
        wall: &EditedWall,
        edits: &[LabelEdit],
        progress: &dyn Progress,
    ) -> Result<Self, TransferError> {
        let near = Neighbourhood::of(edits);
        let mut stones: HashSet<u32> = HashSet::new();
        each_tile(
            tiles,
            labels,
            "stones near edits",
            progress,
            |_, cloud, labels| {
                for (i, &stone) in labels.stone.iter().enumerate().filter(|(_, s)| **s != 0) {
                    if wall.stones.contains(&StoneId(stone)) && !stones.contains(&stone) {
                        let place = (wall.place)(&cloud.world(i)).xy();
                        if near.any.contains(&cell(&place, CELL_M)) {
                            stones.insert(stone);
                        }
                    }
                }
            },
        )?;

        let mut points = Vec::new();
        each_tile(
            tiles,
            labels,
            "points of edits",
            progress,
            |tile, cloud, labels| {
                for (i, &stone) in labels.stone.iter().enumerate() {
                    let is_known = stones.contains(&stone);
                    if !is_known && (stone != 0 || near.added.is_empty()) {
                        continue;
                    }
                    let at: Point3<f64> = (wall.place)(&cloud.world(i));
                    if is_known || near.added.contains(&cell(&at.xy(), CELL_M)) {
                        points.push(WallPoint {
                            place: at.xy(),
                            out_m: at.z,
                            stone,
                            added: false,
                            labelled: stone,
                            tile: tile as u32,
                            index: i as u32,
                        });
                    }
                }
            },
        )?;

        let mut cells: HashMap<[i64; 2], Vec<u32>> = HashMap::new();
        for (i, point) in (0..).zip(&points) {
            cells
                .entry(cell(&point.place, PLACE_REACH_M))
                .or_default()
                .push(i);
        }

        Ok(Self { points, cells })
    }

    /// The stone at a place, as it is now.
    pub(super) fn stone_at(&self, place: &Point2<f64>) -> Option<u32> {
        let [x, y] = cell(place, PLACE_REACH_M);
        let around = (-1..=1).flat_map(|i| (-1..=1).map(move |j| [x + i, y + j]));
        let candidates = around.filter_map(|c| self.cells.get(&c)).flatten();
        candidates
            .map(|&i| &self.points[i as usize])
            .filter(|p| p.stone != 0)
            .map(|p| ((p.place - place).norm(), p.stone))
            .filter(|c| c.0 <= PLACE_REACH_M)
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
            .map(|c| c.1)
    }

    /// Points of every stone that edits can touch, as it is now.
    pub(super) fn by_stone(&self) -> BTreeMap<u32, Vec<usize>> {
        let mut by_stone: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (i, point) in self.points.iter().enumerate().filter(|(_, p)| p.stone != 0) {
            by_stone.entry(point.stone).or_default().push(i);
        }
        by_stone
    }

    /// Stones as labelled whose points each stone has that differs from how it was labelled. Points of added
    /// stones come from none: what was voted for there was not this stone.
    pub(super) fn origins(&self) -> BTreeMap<u32, BTreeSet<u32>> {
        let mut changed: BTreeSet<u32> = BTreeSet::new();
        let mut all: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
        for p in &self.points {
            if p.stone != p.labelled {
                changed.extend([p.stone, p.labelled]);
            }
            if p.stone != 0 {
                let origins = all.entry(p.stone).or_default();
                let is_voted = p.labelled != 0 && !p.added;
                origins.extend(is_voted.then_some(p.labelled));
            }
        }
        all.retain(|stone, _| changed.contains(stone));
        all
    }

    /// Stones as labelled that have no point any more.
    pub(super) fn gone(&self, origins: &BTreeMap<u32, BTreeSet<u32>>) -> BTreeSet<u32> {
        let changed = self.points.iter().filter(|p| p.stone != p.labelled);
        changed
            .map(|p| p.labelled)
            .filter(|s| *s != 0 && !origins.contains_key(s))
            .collect()
    }

    /// Writes the labels of the tiles that changed; which ones.
    pub(super) fn write<S: LabelStore>(
        &self,
        labels: &S,
        target: &mut S,
    ) -> Result<BTreeSet<usize>, TransferError> {
        let mut by_tile: BTreeMap<usize, Vec<&WallPoint>> = BTreeMap::new();
        for p in self.points.iter().filter(|p| p.stone != p.labelled) {
            by_tile.entry(p.tile as usize).or_default().push(p);
        }
        for (&tile, changed) in &by_tile {
            let mut table = labels.read(tile).map_err(|e| TransferError::labels(tile, e))?;
            for p in changed {
                table.stone[p.index as usize] = p.stone;
                if p.added {
                    table.confidence[p.index as usize] = 0.0;
                }
            }
            target
                .write(tile, &table)
                .map_err(|e| TransferError::labels(tile, e))?;
        }
        Ok(by_tile.into_keys().collect())
    }
}

/// Cells around edits.
struct Neighbourhood {
    any: HashSet<[i64; 2]>,
    /// Around outlines that are added.
    added: HashSet<[i64; 2]>,
}

impl Neighbourhood {
    fn of(edits: &[LabelEdit]) -> Self {
        let mut near = Self {
            any: HashSet::new(),
            added: HashSet::new(),
        };
        for edit in edits {
            match edit {
                LabelEdit::Merge(at) | LabelEdit::Delete(at) => {
                    at.iter()
                        .for_each(|p| near.any.extend(box_cells(std::slice::from_ref(p), PLACE_REACH_M)));
                }
                LabelEdit::Split(shape)
                | LabelEdit::CutOut(shape)
                | LabelEdit::MergeInside(shape)
                | LabelEdit::DeleteInside(shape)
                | LabelEdit::Ignore(shape) => {
                    near.any.extend(box_cells(shape, PLACE_REACH_M));
                }
                LabelEdit::Add(shape) => {
                    near.any.extend(box_cells(shape, FACE_REACH_M));
                    near.added.extend(box_cells(shape, 0.0));
                }
            }
        }
        near
    }
}

/// Cells of the box around places, grown by a margin.
fn box_cells(places: &[Point2<f64>], margin_m: f64) -> impl Iterator<Item = [i64; 2]> + use<> {
    let low = places
        .iter()
        .copied()
        .reduce(|a, b| a.inf(&b))
        .unwrap_or_default();
    let high = places
        .iter()
        .copied()
        .reduce(|a, b| a.sup(&b))
        .unwrap_or_default();
    let [x0, y0] = cell(&low.map(|v| v - margin_m), CELL_M);
    let [x1, y1] = cell(&high.map(|v| v + margin_m), CELL_M);
    (x0..=x1).flat_map(move |x| (y0..=y1).map(move |y| [x, y]))
}

fn cell(place: &Point2<f64>, size_m: f64) -> [i64; 2] {
    [place.x, place.y].map(|v| (v / size_m).floor() as i64)
}
