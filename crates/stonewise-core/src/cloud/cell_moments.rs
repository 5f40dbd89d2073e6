//! Sums over the points in a sphere, from sums over cells.

use super::GridIndex;
use crate::geometry::Moments;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Points of an occupied cell, on average, from which on sums over cells save time; below, they would take
/// more memory than the points.
const MIN_POINTS_PER_CELL: usize = 4;

/// Moments of the points of every occupied cell of an index.
///
/// What lies wholly in a sphere counts by its cell, and only cells on its border are looked at point by
/// point.
pub struct CellMoments<'a> {
    index: &'a GridIndex,
    /// About the cell's middle; empty where cells hold too few points.
    cells: Vec<Moments>,
}

impl<'a> CellMoments<'a> {
    /// Sums over all cells. Cost: one pass over the points; 80 bytes an occupied cell.
    pub fn new(index: &'a GridIndex) -> Self {
        let count = index.blocks.occupied();
        if index.len() < MIN_POINTS_PER_CELL * count {
            return Self {
                index,
                cells: Vec::new(),
            };
        }
        let of_cell = |number: usize| {
            let points = &index.points[index.blocks.items(number)];
            let middle = points.first().map_or(Point3::origin(), |p| index.middle_of(p));
            let mut moments = Moments::default();
            for p in points {
                moments.add(&(p - middle));
            }
            moments
        };
        let cells = (0..count)
            .into_par_iter()
            .with_min_len(256)
            .map(of_cell)
            .collect();
        Self { index, cells }
    }

    /// Moments, about `centre`, of the points within `radius_m` (inclusive) of it.
    pub fn within(&self, centre: &Point3<f64>, radius_m: f64) -> Moments {
        let mut sum = Moments::default();
        if self.cells.is_empty() {
            self.index
                .positions_within(centre, radius_m, |_, p| sum.add(&(p - centre)));
            return sum;
        }

        let Some(cells) = self.index.cells_around(centre, radius_m) else {
            return sum;
        };
        let (r2, half) = (radius_m * radius_m, 0.5 * self.index.cell_m);
        self.index.blocks.for_each_cell(&cells, |number, cell| {
            let middle = self.index.middle(cell) - centre;
            let far = middle.abs().add_scalar(half).norm_squared();
            // Rounding puts points of a cell's border outside it, by far less than this.
            if far < r2 * (1.0 - 1e-9) {
                sum.add_moved(&self.cells[number], &middle);
                return;
            }
            let near = middle
                .abs()
                .add_scalar(-half)
                .sup(&Vector3::zeros())
                .norm_squared();
            if near > r2 * (1.0 + 1e-9) {
                return;
            }
            for p in &self.index.points[self.index.blocks.items(number)] {
                let q = p - centre;
                if q.norm_squared() <= r2 {
                    sum.add(&q);
                }
            }
        });

        sum
    }
}

impl GridIndex {
    /// Middle of a cell.
    fn middle(&self, cell: [usize; 3]) -> Point3<f64> {
        self.origin + Vector3::from(cell.map(|c| (c as f64 + 0.5) * self.cell_m))
    }

    /// Middle of the cell that holds a point of the cloud.
    fn middle_of(&self, p: &Point3<f64>) -> Point3<f64> {
        self.middle(self.cell_of(p))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn spheres_hold_what_brute_force_finds() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        let origin = Point3::new(4.5e5, 5.6e6, 300.0);
        let cloud: Vec<Point3<f64>> = (0..20_000)
            .map(|_| origin + Vector3::from([1.0, 0.03, 0.8].map(|s| s * rng.random_range(-1.0..1.0))))
            .collect();
        let mut counted = 0.0;
        // Cells of few points have no moments.
        for cell in [0.02, 0.05, 0.3] {
            let index = GridIndex::new(&cloud, cell);
            let moments = CellMoments::new(&index);
            assert_eq!(moments.cells.is_empty(), cell < 0.03);
            for i in (0..cloud.len()).step_by(997) {
                let centre = cloud[i] + Vector3::new(0.0, rng.random_range(-0.1..0.1), 0.0);
                let found = moments.within(&centre, 0.25);
                let mut expected = Moments::default();
                for p in cloud
                    .iter()
                    .filter(|p| (*p - centre).norm_squared() <= 0.25 * 0.25)
                {
                    expected.add(&(p - centre));
                }
                assert_eq!(found.count, expected.count);
                let scale = 1e-13 * expected.count;
                assert!((found.sum - expected.sum).amax() < scale);
                assert!((found.square() - expected.square()).amax() < scale);
                counted += found.count;
            }
        }
        assert!(counted > 10_000.0);
        let nothing = CellMoments::new(&GridIndex::new(&[], 1.0)).within(&Point3::origin(), 9.0);
        assert_eq!(nothing.count, 0.0);
    }
}
