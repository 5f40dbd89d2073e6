//! Surfaces off the wall that both epochs show: candidates for stable areas.

use crate::error::Result;
use crate::pipeline::steps::label::Labelled;
use nalgebra::{Matrix3, Point3, Vector3};
use std::collections::{BTreeMap, HashMap};
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::Pair;
use stonewise_core::geometry::{Bounds, cell_of};
use stonewise_core::progress::Progress;
use stonewise_core::stone::Stone;

/// Edge of the cells in which points are counted, metres.
const CELL_M: f64 = 0.25;
/// Edge of an area, metres: the smallest piece that is left out when it has moved.
const AREA_M: f64 = 2.0;
/// A cell whose middle lies closer to the face, or to its continuation, may hold points of the wall, metres:
/// half its diagonal and 0.3 m.
const LEAST_DISTANCE_M: f64 = 0.52;
/// Surfaces at most this many cells apart across their plane are one area: their layers touch.
const SAME_AREA_CELLS: i64 = 2;
/// Points in a cell, in each epoch, that show a surface: two sources with twelve each.
const LEAST_POINTS: u32 = 24;
/// Stones that stand for the face, at most; they are spread over the list.
const FACE_STONES: usize = 400;

/// Cells off the wall, and the area that each belongs to.
///
/// A cell's neighbours in front of and behind its surface belong to the same area. Without them, a surface
/// that lies on the boundary of two cells would lose the noise of its points on one side, or be cut into two
/// areas along it, and both pull its mean plane.
#[derive(Clone, Debug, Default)]
pub struct OffWall {
    cells: HashMap<[i64; 3], usize>,
    /// Lowest and highest corner of each area's cells.
    areas: Vec<[Point3<f64>; 2]>,
}

impl OffWall {
    /// Finds them in one pass over the tiles of both epochs.
    pub fn find(epochs: Pair<&Labelled>, progress: &dyn Progress) -> Result<Self> {
        let face = Face::new(&epochs.first.stones);
        let mut contents: HashMap<[i64; 3], CellPoints> = HashMap::new();
        for (number, epoch) in epochs.into_iter().enumerate() {
            let tiles = &epoch.ingested.tiles;
            let load = |tile| -> Result<_> { tiles.load(tile) };
            progress.each_prepared("look off the wall", 0..tiles.tile_count(), load, |_, cloud| {
                for i in 0..cloud.len() {
                    let cell = cell_of(&cloud.world(i), CELL_M);
                    let place = cloud.world(i) - middle(&cell);
                    contents.entry(cell).or_default().add(number, &place);
                }
                Ok(())
            })?;
        }
        let surfaces = contents.iter().filter_map(|(cell, points)| {
            let surface = Surface {
                cell: *cell,
                across: points.normal_axis()?,
            };
            let is_off = |cell: &[i64; 3]| face.distance(&middle(cell)) > LEAST_DISTANCE_M;
            surface.layers().iter().all(is_off).then_some(surface)
        });
        Ok(Self::of_surfaces(surfaces))
    }

    fn of_surfaces(surfaces: impl Iterator<Item = Surface>) -> Self {
        let mut blocks: BTreeMap<(usize, [i64; 2]), BTreeMap<i64, Vec<Surface>>> = BTreeMap::new();
        for surface in surfaces {
            let heights = blocks.entry((surface.across, surface.block())).or_default();
            heights
                .entry(surface.cell[surface.across])
                .or_default()
                .push(surface);
        }

        let mut found = Self::default();
        let mut neighbours = Vec::new();
        for heights in blocks.values() {
            let mut last = None;
            for (height, surfaces) in heights {
                if last.is_none_or(|last| height - last > SAME_AREA_CELLS) {
                    found
                        .areas
                        .push([Point3::from([f64::MAX; 3]), Point3::from([f64::MIN; 3])]);
                }
                last = Some(*height);
                for surface in surfaces {
                    found.insert(surface.cell);
                    neighbours.extend(surface.layers().map(|cell| (cell, found.areas.len() - 1)));
                }
            }
        }

        neighbours.sort_unstable();
        for (cell, area) in neighbours {
            found.cells.entry(cell).or_insert(area);
        }
        found
    }

    /// Adds a cell to the newest area.
    fn insert(&mut self, cell: [i64; 3]) {
        let number = self.areas.len() - 1;
        self.cells.insert(cell, number);
        let corner = |end: f64| Point3::from(cell.map(|k| (k as f64 + end) * CELL_M));
        if let Some([low, high]) = self.areas.last_mut() {
            *low = low.inf(&corner(0.0));
            *high = high.sup(&corner(1.0));
        }
    }

    /// The area that a point lies in.
    pub fn area(&self, p: &Point3<f64>) -> Option<usize> {
        self.cells.get(&cell_of(p, CELL_M)).copied()
    }

    /// Every nth area in order, with n such that at most `most` areas are left.
    pub fn thinned(&self, most: usize) -> Self {
        let stride = self.areas.len().div_ceil(most.max(1)).max(1);
        let kept = |area: usize| area.is_multiple_of(stride);
        Self {
            cells: self
                .cells
                .iter()
                .filter(|(_, area)| kept(**area))
                .map(|(cell, area)| (*cell, area / stride))
                .collect(),
            areas: self.areas.iter().step_by(stride).copied().collect(),
        }
    }

    /// Bounds of each area and of the cells in front of and behind it.
    pub fn bounds(&self) -> Vec<Bounds> {
        let layer = Vector3::repeat(CELL_M);
        let widened = |[low, high]: &[Point3<f64>; 2]| Bounds {
            min: low - layer,
            max: high + layer,
        };
        self.areas.iter().map(widened).collect()
    }

    /// Lowest and highest corner of each area.
    pub fn areas(&self) -> &[[Point3<f64>; 2]] {
        &self.areas
    }
}

fn middle(cell: &[i64; 3]) -> Point3<f64> {
    Point3::from(cell.map(|k| (k as f64 + 0.5) * CELL_M))
}

/// The points of a cell: how many of each epoch, and their sums of places and of products about the cell's
/// middle.
#[derive(Clone, Default)]
struct CellPoints {
    counts: [u32; 2],
    sum: Vector3<f64>,
    products: Matrix3<f64>,
}

impl CellPoints {
    fn add(&mut self, epoch: usize, place: &Vector3<f64>) {
        self.counts[epoch] += 1;
        self.sum += place;
        self.products += place * place.transpose();
    }

    /// The axis nearest to the normal of the cell's surface; `None` where an epoch has too few points.
    fn normal_axis(&self) -> Option<usize> {
        if self.counts.iter().any(|n| *n < LEAST_POINTS) {
            return None;
        }
        let n = f64::from(self.counts.iter().sum::<u32>());
        let covariance = self.products / n - (self.sum / n) * (self.sum / n).transpose();
        let eigen = covariance.symmetric_eigen();
        Some(eigen.eigenvectors.column(eigen.eigenvalues.imin()).iamax())
    }
}

/// A cell that both epochs show, and the axis nearest to its normal.
struct Surface {
    cell: [i64; 3],
    across: usize,
}

impl Surface {
    /// The cell behind it, itself, and the cell in front.
    fn layers(&self) -> [[i64; 3]; 3] {
        [-1, 0, 1].map(|step| {
            let mut cell = self.cell;
            cell[self.across] += step;
            cell
        })
    }

    /// Its place along the surface, in areas.
    fn block(&self) -> [i64; 2] {
        let area = cell_of(&middle(&self.cell), AREA_M);
        [1, 2].map(|k| area[(self.across + k) % 3])
    }
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
    fn surfaces_make_areas_of_two_metres() {
        let surfaces = (0..16).map(|i| Surface {
            cell: [i, 0, -1],
            across: 2,
        });
        let found = OffWall::of_surfaces(surfaces);
        assert_eq!(found.areas().len(), 2);
        assert_eq!(
            found.areas()[0],
            [Point3::new(0.0, 0.0, -0.25), Point3::new(2.0, 0.25, 0.0)]
        );
        assert_eq!(found.area(&Point3::new(3.9, 0.2, -0.1)), Some(1));
        assert_eq!(found.area(&Point3::new(3.9, 0.2, 0.1)), Some(1));
        assert_eq!(found.area(&Point3::new(3.9, 0.2, 0.3)), None);
        assert_eq!(found.area(&Point3::new(4.1, 0.2, -0.1)), None);
        let thinned = found.thinned(1);
        assert_eq!(thinned.areas(), &found.areas()[..1]);
        assert_eq!(thinned.area(&Point3::new(0.1, 0.2, 0.1)), Some(0));
        assert_eq!(thinned.area(&Point3::new(3.9, 0.2, -0.1)), None);
        assert!(thinned.bounds()[0].contains(&Point3::new(0.1, 0.2, 0.2)));
    }

    #[test]
    fn a_surface_on_a_boundary_is_one_area_with_all_its_points() {
        let level = |x: i64, z: i64| Surface {
            cell: [x, 0, z],
            across: 2,
        };
        let found = OffWall::of_surfaces([level(0, -1), level(0, 0), level(1, 0)].into_iter());
        assert_eq!(found.areas().len(), 1);
        for x in [0.2, 0.3] {
            for z in [-0.02, 0.02] {
                assert_eq!(found.area(&Point3::new(x, 0.2, z)), Some(0));
            }
        }
    }

    #[test]
    fn the_axis_across_a_surface_is_that_of_its_least_scatter() {
        let mut points = CellPoints::default();
        for i in 0..100 {
            let (u, v) = (0.02 * f64::from(i % 10), 0.02 * f64::from(i / 10));
            points.add(i as usize % 2, &Vector3::new(0.3 * u, u, v));
        }
        assert_eq!(points.normal_axis(), Some(0));
        points.counts[1] = LEAST_POINTS - 1;
        assert_eq!(points.normal_axis(), None);
    }
}
