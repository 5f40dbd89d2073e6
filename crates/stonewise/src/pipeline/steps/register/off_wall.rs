//! Surfaces off the wall that both epochs show: candidates for stable areas.

use crate::error::Result;
use crate::pipeline::steps::label::Labelled;
use nalgebra::{Point3, Vector3};
use std::collections::{BTreeMap, HashMap};
use stonewise_core::cloud::TileSource;
use stonewise_core::geometry::cell_of;
use stonewise_core::progress::Progress;
use stonewise_core::stone::Stone;

/// Edge of the cells in which points are counted, metres.
const CELL_M: f64 = 0.5;
/// Edge of an area, metres: the smallest piece that is left out when it has moved.
const AREA_M: f64 = 2.0;
/// A cell whose middle lies closer to the face, or to its continuation, may hold points of the wall, metres: half its diagonal
/// and 0.3 m.
const LEAST_DISTANCE_M: f64 = 0.75;
/// Points in a cell, in each epoch, that show a surface.
const LEAST_POINTS: u32 = 40;
/// Stones that stand for the face, at most; they are spread over the list.
const FACE_STONES: usize = 400;

/// Cells off the wall, and the area that each belongs to.
#[derive(Clone, Debug, Default)]
pub struct OffWall {
    cells: HashMap<[i64; 3], usize>,
    /// Lowest and highest corner of each area's cells.
    areas: Vec<[Point3<f64>; 2]>,
}

impl OffWall {
    /// Finds them in one pass over the tiles of both epochs.
    pub fn find(epochs: [&Labelled; 2], progress: &dyn Progress) -> Result<Self> {
        let face = Face::new(&epochs[0].stones);
        let mut counts: HashMap<[i64; 3], [u32; 2]> = HashMap::new();
        for (number, epoch) in epochs.iter().enumerate() {
            let tiles = &epoch.ingested.tiles;
            progress.begin("look off the wall", tiles.tile_count() as u64);
            for tile in 0..tiles.tile_count() {
                progress.check()?;
                let cloud = tiles.load(tile)?;
                for i in 0..cloud.len() {
                    let cell = cell_of(&cloud.world(i), CELL_M);
                    counts.entry(cell).or_default()[number] += 1;
                }
                progress.advance(1);
            }
        }
        let is_seen = |counts: &[u32; 2]| counts.iter().all(|n| *n >= LEAST_POINTS);
        let seen = counts.iter().filter(|(_, n)| is_seen(n)).map(|(cell, _)| *cell);
        Ok(Self::of_cells(
            seen.filter(|cell| face.distance(&middle(cell)) > LEAST_DISTANCE_M),
        ))
    }

    fn of_cells(cells: impl Iterator<Item = [i64; 3]>) -> Self {
        let mut by_area: BTreeMap<[i64; 3], Vec<[i64; 3]>> = BTreeMap::new();
        for cell in cells {
            by_area
                .entry(cell_of(&middle(&cell), AREA_M))
                .or_default()
                .push(cell);
        }
        let mut found = Self::default();
        for (number, cells) in by_area.into_values().enumerate() {
            let corner = |cell: &[i64; 3], end: f64| Point3::from(cell.map(|k| (k as f64 + end) * CELL_M));
            let low = cells.iter().map(|c| corner(c, 0.0)).reduce(|a, b| a.inf(&b));
            let high = cells.iter().map(|c| corner(c, 1.0)).reduce(|a, b| a.sup(&b));
            found.areas.extend(low.zip(high).map(|(low, high)| [low, high]));
            found.cells.extend(cells.into_iter().map(|cell| (cell, number)));
        }
        found
    }

    /// The area that a point lies in.
    pub fn area(&self, p: &Point3<f64>) -> Option<usize> {
        self.cells.get(&cell_of(p, CELL_M)).copied()
    }

    /// Lowest and highest corner of each area.
    pub fn areas(&self) -> &[[Point3<f64>; 2]] {
        &self.areas
    }
}

fn middle(cell: &[i64; 3]) -> Point3<f64> {
    Point3::from(cell.map(|k| (k as f64 + 0.5) * CELL_M))
}

/// The face of the wall and its continuation: the tangent planes of some stones.
struct Face {
    planes: Vec<(Point3<f64>, Vector3<f64>)>,
}

impl Face {
    fn new(stones: &[Stone]) -> Self {
        let step = stones.len().div_ceil(FACE_STONES).max(1);
        Self {
            planes: stones
                .iter()
                .step_by(step)
                .map(|s| (s.centroid, s.normal))
                .collect(),
        }
    }

    /// Distance from the tangent plane of the nearest stone, metres; zero without stones.
    fn distance(&self, p: &Point3<f64>) -> f64 {
        let nearest = self.planes.iter().min_by(|a, b| {
            let [a, b] = [a, b].map(|plane| (plane.0 - p).norm_squared());
            a.total_cmp(&b)
        });
        nearest.map_or(0.0, |(centre, normal)| (p - centre).dot(normal).abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::id::StoneId;

    fn stone(y: f64, z: f64) -> Stone {
        Stone {
            id: StoneId(1),
            centroid: Point3::new(0.0, y, z),
            normal: Vector3::x(),
            area_m2: 0.05,
            points: 100,
            photos: 2,
            confidence: 1.0,
        }
    }

    #[test]
    fn the_wall_beyond_its_last_stone_is_still_the_wall() {
        let face = Face::new(&[stone(0.0, 0.0), stone(1.0, 0.0), stone(0.5, 1.0)]);
        assert!(face.distance(&Point3::new(0.1, 30.0, 5.0)) < 0.2);
        assert!((face.distance(&Point3::new(-3.0, 0.4, 2.0)) - 3.0).abs() < 1e-12);
        assert_eq!(Face::new(&[]).distance(&Point3::new(9.0, 0.0, 0.0)), 0.0);
    }

    #[test]
    fn cells_make_areas_of_two_metres() {
        let cells = (0..8).map(|i| [i, 0, -1]);
        let found = OffWall::of_cells(cells);
        assert_eq!(found.areas().len(), 2);
        assert_eq!(
            found.areas()[0],
            [Point3::new(0.0, 0.0, -0.5), Point3::new(2.0, 0.5, 0.0)]
        );
        assert_eq!(found.area(&Point3::new(3.9, 0.2, -0.1)), Some(1));
        assert_eq!(found.area(&Point3::new(3.9, 0.2, 0.1)), None);
    }
}
