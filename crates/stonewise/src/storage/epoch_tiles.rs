//! The points of an epoch as every step after labelling sees them.

use crate::error::{Error, Result};
use crate::storage::labels::DiskLabels;
use crate::storage::tiles::DiskTiles;
use nalgebra::{Point3, Vector3};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::evaluate::MotionField;
use stonewise_core::geometry::Bounds;
use stonewise_core::transfer::LabelStore;

/// Edge of the cells in which the places of moved stones are kept, metres. A place that photos show moves with a stone
/// if a point of the stone lies within about this distance.
const CELL_M: f64 = 0.03;

/// An epoch's tiles, moved where the project prescribes a motion.
pub struct EpochTiles {
    /// The tiles as surveyed.
    pub surveyed: DiskTiles,
    /// The motion.
    pub motion: Option<KnownMotion>,
}

/// A motion that the project prescribes.
#[derive(Clone)]
pub struct KnownMotion {
    /// How every point moves that belongs to no stone.
    pub field: MotionField,
    /// Stones that move as a whole, once they are known.
    stones: Option<Arc<MovedStones>>,
}

/// Moved places of stones by cell, with their displacements; one for each stone of a cell.
type Places = HashMap<[i64; 3], Vec<(Point3<f64>, Vector3<f64>)>>;

struct MovedStones {
    labels: DiskLabels,
    displacements: BTreeMap<u32, Vector3<f64>>,
    places: Places,
}

impl KnownMotion {
    /// Every point moves as the field says.
    pub fn of_points(field: MotionField) -> Self {
        Self { field, stones: None }
    }

    /// The same, but the stones of these labels move by their displacements. Cost: one pass over the tiles.
    ///
    /// # Errors
    /// Tiles or labels cannot be read.
    pub fn of_stones(
        field: MotionField,
        labels: DiskLabels,
        displacements: BTreeMap<u32, Vector3<f64>>,
        surveyed: &DiskTiles,
    ) -> Result<Self> {
        let mut places = Places::new();
        for tile in 0..surveyed.tile_count() {
            let (cloud, stones) = (surveyed.load(tile)?, labels.read(tile)?.stone);
            for (i, stone) in stones.iter().enumerate() {
                let Some(displacement) = displacements.get(stone) else {
                    continue;
                };
                let moved = cloud.world(i) + displacement;
                let of_cell = places.entry(cell(&moved)).or_default();
                if of_cell.iter().all(|(_, other)| other != displacement) {
                    of_cell.push((moved, *displacement));
                }
            }
        }
        Ok(Self {
            field,
            stones: Some(Arc::new(MovedStones {
                labels,
                displacements,
                places,
            })),
        })
    }

    /// Where a moved point was.
    pub fn before(&self, moved: &Point3<f64>) -> Point3<f64> {
        let of_stone = self.stones.as_ref().and_then(|stones| stones.near(moved));
        of_stone.map_or_else(|| self.field.undo(moved), |displacement| moved - displacement)
    }

    fn apply(&self, tile: usize, cloud: &Cloud) -> Result<Cloud> {
        let displaced: Vec<Option<Vector3<f64>>> = match &self.stones {
            Some(stones) => {
                let of_points = stones.labels.read(tile)?.stone;
                let displacement = |stone| stones.displacements.get(stone).copied();
                of_points.iter().map(displacement).collect()
            }
            None => vec![None; cloud.len()],
        };
        let moved = displaced.into_iter().enumerate().map(|(i, displacement)| {
            let p = cloud.world(i);
            displacement.map_or_else(|| self.field.apply(&p), |d| p + d)
        });
        Ok(Cloud::from_world(cloud.origin(), moved))
    }
}

impl MovedStones {
    /// The displacement of the stone nearest to a moved point, among those with a place in its cell or a neighbouring
    /// one.
    fn near(&self, moved: &Point3<f64>) -> Option<Vector3<f64>> {
        let [x, y, z] = cell(moved);
        let around = (0..27).map(|k| [x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1]);
        let places = around.filter_map(|cell| self.places.get(&cell)).flatten();
        let apart = |(place, _): &&(Point3<f64>, Vector3<f64>)| (place - moved).norm_squared();
        places
            .min_by(|a, b| apart(a).total_cmp(&apart(b)))
            .map(|(_, displacement)| *displacement)
    }
}

fn cell(p: &Point3<f64>) -> [i64; 3] {
    [p.x, p.y, p.z].map(|c| (c / CELL_M).floor() as i64)
}

impl TileSource for EpochTiles {
    type Error = Error;

    fn tile_count(&self) -> usize {
        self.surveyed.tile_count()
    }

    /// Bounds that hold the moved points, but are not tight.
    fn bounds(&self, tile: usize) -> Bounds {
        let reach_m = self.motion.as_ref().map_or(0.0, |m| m.field.largest_m());
        self.surveyed.bounds(tile).grown(reach_m)
    }

    fn load(&self, tile: usize) -> Result<Cloud> {
        let cloud = self.surveyed.load(tile)?;
        match &self.motion {
            Some(motion) => motion.apply(tile, &cloud),
            None => Ok(cloud),
        }
    }
}
