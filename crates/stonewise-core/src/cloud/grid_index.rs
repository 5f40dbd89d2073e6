//! Neighbour search in a cloud of nearly even spacing.

use super::blocks::{Blocks, CellBox};
use nalgebra::Point3;
use std::ops::Range;

/// Points sorted into cubic cells, for searches within a radius and for nearest neighbours.
///
/// Built once and searched often; a search visits only the cells that its sphere touches. Best where the cell
/// is about as large as the usual search radius. Results come in ascending order of point index within a cell
/// and of cell, so they do not depend on threads. Memory: 28 bytes a point, 4 an occupied cell, 12 an
/// occupied block of 4 x 4 x 4 cells and 4 a block of the box around the cloud.
pub struct GridIndex {
    pub(super) points: Vec<Point3<f64>>,
    /// Index of each sorted point in the input.
    pub(super) order: Vec<u32>,
    pub(super) blocks: Blocks,
    pub(super) origin: Point3<f64>,
    pub(super) cell_m: f64,
    pub(super) dims: [usize; 3],
}

/// First radius of a search for the nearest point, in cells: around a point of the same cloud it finds one in
/// 96 of 100 cases where a cell holds four points of a surface, in at most eight cells.
const FIRST_RADIUS_CELLS: f64 = 0.5;
/// Cells along the edge of a cube whose points share their candidates for the nearest point.
const CUBE_CELLS: usize = 2;
/// Points of a surface that a cell holds where [`GridIndex::for_nearest`] chooses it: fewer cost more cells a
/// search, more cost more distances.
const POINTS_PER_CELL: f64 = 4.0;
/// Fewest and most points of the usual cell with which [`GridIndex::for_nearest`] is content; between them a
/// search takes half as long again at most.
const GOOD_CELL: std::ops::RangeInclusive<usize> = 2..=12;
/// Most cells that [`GridIndex::for_nearest`] tries. Three follow a cloud in a box of a thousand times its
/// area.
const TRIALS: usize = 5;
/// Points whose cells show the usual one: the median of their numbers is then known to some percent.
const CELL_SAMPLES: usize = 500;
/// Smallest cell of [`GridIndex::for_nearest`], metres: below the resolution of any scanner.
const MIN_CELL_M: f64 = 1e-3;

impl GridIndex {
    /// Sorts the points into cells of about `cell_m` metres (positive); the cell grows where the box around
    /// the cloud would take more than 30 million blocks.
    pub fn new(points: &[Point3<f64>], cell_m: f64) -> Self {
        let bounds = crate::geometry::Bounds::of(points.iter().copied());
        let (origin, extent) = bounds.map_or((Point3::origin(), nalgebra::Vector3::zeros()), |b| {
            (b.min, b.max - b.min)
        });
        let mut cell_m = if cell_m > 0.0 { cell_m } else { 1.0 };
        while !Blocks::can_hold(extent.map(|e| (e / cell_m).floor() + 1.0).into()) {
            cell_m *= 1.26;
        }
        let dims = [0, 1, 2].map(|i| (extent[i] / cell_m).floor() as usize + 1);
        let cell_of =
            |p: &Point3<f64>| [0, 1, 2].map(|a| (((p[a] - origin[a]) / cell_m) as usize).min(dims[a] - 1));
        let (blocks, order) = Blocks::sort(dims, points.iter().map(cell_of));
        let points = order.iter().map(|&i| points[i as usize]).collect();
        Self {
            points,
            order,
            blocks,
            origin,
            cell_m,
            dims,
        }
    }

    /// An index for searches of the nearest point: the cell follows the density around the usual point, so
    /// that a few stray points do not coarsen it.
    pub fn for_nearest(points: &[Point3<f64>]) -> Self {
        let mut index = Self::new(points, guessed_cell(points));
        for _ in 1..TRIALS {
            let usual = index.usual_cell();
            let better = index.cell_m * (POINTS_PER_CELL / usual.max(1) as f64).sqrt();
            if GOOD_CELL.contains(&usual) || better < MIN_CELL_M {
                break;
            }
            let next = Self::new(points, better);
            let is_stuck = (next.cell_m / index.cell_m - 1.0).abs() < 0.1;
            index = next;
            if is_stuck {
                break;
            }
        }
        index
    }

    /// Number of points in the cell of the usual point.
    fn usual_cell(&self) -> usize {
        let samples = (0..self.len()).step_by(self.len().div_ceil(CELL_SAMPLES).max(1));
        let mut counts: Vec<usize> = samples.map(|slot| self.blocks.cell_around(slot).len()).collect();
        counts.sort_unstable();
        counts.get(counts.len() / 2).copied().unwrap_or(0)
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Calls `visit(index, squared distance)` for every point within `radius_m` (inclusive) of `centre`.
    #[inline]
    pub fn within(&self, centre: &Point3<f64>, radius_m: f64, mut visit: impl FnMut(usize, f64)) {
        let r2 = radius_m * radius_m;
        self.for_each_run(centre, radius_m, |run| {
            for (p, &i) in self.points[run.clone()].iter().zip(&self.order[run]) {
                let d2 = (p - centre).norm_squared();
                if d2 <= r2 {
                    visit(i as usize, d2);
                }
            }
        });
    }

    /// The points that [`within`](Self::within) finds, with their positions in place of the distances.
    #[inline]
    pub fn positions_within(
        &self,
        centre: &Point3<f64>,
        radius_m: f64,
        mut visit: impl FnMut(usize, &Point3<f64>),
    ) {
        let r2 = radius_m * radius_m;
        self.for_each_run(centre, radius_m, |run| {
            for (p, &i) in self.points[run.clone()].iter().zip(&self.order[run]) {
                if (p - centre).norm_squared() <= r2 {
                    visit(i as usize, p);
                }
            }
        });
    }

    /// Whether any point lies within `radius_m` (inclusive) of `centre`; stops at the first.
    pub fn any_within(&self, centre: &Point3<f64>, radius_m: f64) -> bool {
        let r2 = radius_m * radius_m;
        self.cells_around(centre, radius_m).is_some_and(|cells| {
            self.blocks.any_run(&cells, |run| {
                self.points[run].iter().any(|p| (p - centre).norm_squared() <= r2)
            })
        })
    }

    /// The nearest point within `max_m`, as (index, squared distance); the lower index wins a tie.
    pub fn nearest(&self, centre: &Point3<f64>, max_m: f64) -> Option<(usize, f64)> {
        let mut radius = (FIRST_RADIUS_CELLS * self.cell_m).min(max_m);
        loop {
            let best = self.nearest_in_box(centre, radius);
            match best {
                Some((_, d2)) if d2 <= radius * radius => return best,
                _ if radius >= max_m => return None,
                // Something in a corner of the box: the nearest is no farther. The factor covers the root's
                // rounding.
                Some((_, d2)) => radius = (d2.sqrt() * (1.0 + 1e-12)).min(max_m),
                None => radius = (2.0 * radius).min(max_m),
            }
        }
    }

    /// The cube of cells that contains a point; all points in it have the same candidates for the nearest point.
    pub(super) fn cube_of(&self, p: &Point3<f64>) -> [usize; 3] {
        self.cell_of(p).map(|c| c / CUBE_CELLS)
    }

    /// Calls `visit` with the points in a cube of cells and in the cells around it, run by run, until it returns true.
    pub(super) fn any_around_cube(
        &self,
        cube: [usize; 3],
        mut visit: impl FnMut(&[Point3<f64>]) -> bool,
    ) -> bool {
        let cells = [0, 1, 2].map(|a| {
            let first = CUBE_CELLS * cube[a];
            (
                first.saturating_sub(1),
                (first + CUBE_CELLS).min(self.dims[a] - 1),
            )
        });
        self.blocks.any_run(&cells, |run| visit(&self.points[run]))
    }

    /// The nearest of the points in all cells that a sphere's box touches.
    fn nearest_in_box(&self, centre: &Point3<f64>, radius_m: f64) -> Option<(usize, f64)> {
        let (mut least, mut at) = (f64::INFINITY, u32::MAX);
        self.blocks.any_run(&self.cells_around(centre, radius_m)?, |run| {
            for (p, &i) in self.points[run.clone()].iter().zip(&self.order[run]) {
                let d2 = (p - centre).norm_squared();
                if d2 < least || (d2 == least && i < at) {
                    (least, at) = (d2, i);
                }
            }
            false
        });
        (at != u32::MAX).then_some((at as usize, least))
    }

    /// The `k` nearest points within `max_m`, nearest first, as (index, squared distance).
    pub fn nearest_k(&self, centre: &Point3<f64>, k: usize, max_m: f64) -> Vec<(usize, f64)> {
        let mut radius = self.cell_m.min(max_m);
        let mut found = Vec::new();
        loop {
            found.clear();
            self.within(centre, radius, |i, d2| found.push((i, d2)));
            if found.len() >= k || radius >= max_m {
                sort_nearest(&mut found, k);
                return found;
            }
            radius = (radius * growth(found.len(), k)).min(max_m);
        }
    }

    /// Where in the index' order of blocks a point would lie, and in which cube of the block: searches in this order
    /// mostly hit the processor's cache.
    pub fn place_of(&self, p: &Point3<f64>) -> (u32, u8) {
        let bit = |c: usize| (c / CUBE_CELLS % CUBE_CELLS) as u8;
        let cell = self.cell_of(p);
        let [i, j, k] = cell.map(bit);
        (self.blocks.place_of(&cell) as u32, 4 * k + 2 * j + i)
    }

    /// The cell that holds a point, or the nearest one outside the cloud's box.
    pub(super) fn cell_of(&self, p: &Point3<f64>) -> [usize; 3] {
        [0, 1, 2].map(|a| (((p[a] - self.origin[a]) / self.cell_m) as usize).min(self.dims[a] - 1))
    }

    /// Cells that the box around a sphere touches; `None` where it lies outside the cloud's box.
    #[inline]
    pub(super) fn cells_around(&self, centre: &Point3<f64>, radius_m: f64) -> Option<CellBox> {
        let mut cells = [(0, 0); 3];
        for (a, cell) in cells.iter_mut().enumerate() {
            let middle = centre[a] - self.origin[a];
            let from = (centre[a] - radius_m - self.origin[a]) / self.cell_m;
            let to = (centre[a] + radius_m - self.origin[a]) / self.cell_m;
            if middle.is_nan() || to < 0.0 || from >= self.dims[a] as f64 {
                return None;
            }
            // Negative numbers become 0.
            *cell = (from as usize, (to as usize).min(self.dims[a] - 1));
        }
        (!self.points.is_empty()).then_some(cells)
    }

    #[inline]
    fn for_each_run(&self, centre: &Point3<f64>, radius_m: f64, visit: impl FnMut(Range<usize>)) {
        if let Some(cells) = self.cells_around(centre, radius_m) {
            self.blocks.for_each_run(&cells, visit);
        }
    }
}

/// Leaves the `k` nearest, nearest first; the lower index first among equals.
pub(crate) fn sort_nearest(found: &mut Vec<(usize, f64)>, k: usize) {
    let order = |a: &(usize, f64), b: &(usize, f64)| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0));
    if k > 0 && found.len() > k {
        found.select_nth_unstable_by(k - 1, order);
    }
    found.truncate(k);
    found.sort_unstable_by(order);
}

/// Factor by which to enlarge a radius that holds `found` points of a surface where `wanted` are needed;
/// about 1.5 times `wanted` are then to be expected.
fn growth(found: usize, wanted: usize) -> f64 {
    (1.5 * wanted as f64 / found.max(1) as f64).sqrt().clamp(1.2, 2.0)
}

/// A cell with [`POINTS_PER_CELL`] points where they are spread over the largest face of their box.
fn guessed_cell(points: &[Point3<f64>]) -> f64 {
    crate::geometry::Bounds::of(points.iter().copied()).map_or(1.0, |b| {
        let e = b.max - b.min;
        let face = (e.x * e.y).max(e.y * e.z).max(e.z * e.x);
        (POINTS_PER_CELL * face / points.len() as f64)
            .sqrt()
            .max(MIN_CELL_M)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn clouds() -> Vec<Vec<Point3<f64>>> {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut uniform = |scale: [f64; 3], n: usize| -> Vec<Point3<f64>> {
            (0..n)
                .map(|_| Point3::from(scale.map(|s| s * rng.random_range(-1.0..1.0))))
                .collect()
        };
        let mut repeated = uniform([1.0, 1.0, 1.0], 50);
        repeated.extend(repeated.clone());
        vec![
            uniform([1.0, 1.0, 1.0], 800),
            uniform([5.0, 5.0, 0.01], 800),
            uniform([9.0, 0.0, 0.0], 200),
            repeated,
        ]
    }

    /// Points by distance, the lower index first among equals.
    fn by_distance(cloud: &[Point3<f64>], centre: &Point3<f64>) -> Vec<(usize, f64)> {
        let distances = cloud.iter().map(|p| (p - centre).norm_squared());
        let mut all: Vec<(usize, f64)> = distances.enumerate().collect();
        all.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        all
    }

    #[test]
    fn radius_and_nearest_agree_with_brute_force() {
        for (cloud, cell) in clouds()
            .into_iter()
            .flat_map(|c| [0.02, 0.3, 7.0].map(|cell| (c.clone(), cell)))
        {
            let index = GridIndex::new(&cloud, cell);
            let outside = [[20.0, 0.0, 0.0], [0.1, -2.0, 0.3], [-1.0, -1.0, -1.0]].map(Point3::from);
            for centre in cloud.iter().step_by(17).chain(&outside) {
                let all = by_distance(&cloud, centre);
                for radius in [0.0, 0.05, 0.31, 2.0] {
                    let expected: Vec<(usize, f64)> =
                        all.iter().filter(|p| p.1 <= radius * radius).copied().collect();
                    let mut found = Vec::new();
                    index.within(centre, radius, |i, d2| found.push((i, d2)));
                    found.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
                    assert_eq!(found, expected);
                    assert_eq!(index.any_within(centre, radius), !expected.is_empty());
                    assert_eq!(index.nearest(centre, radius), expected.first().copied());
                    let four = &expected[..expected.len().min(4)];
                    assert_eq!(index.nearest_k(centre, 4, radius), four);
                }
                assert_eq!(index.nearest(centre, 1e3), Some(all[0]));
                assert_eq!(index.nearest_k(centre, 25, 1e3), all[..25]);
            }
        }
    }

    #[test]
    fn points_come_by_cell_and_index_in_it() {
        let cloud = &clouds()[0];
        let index = GridIndex::new(cloud, 0.3);
        let low = Point3::from([0, 1, 2].map(|a| cloud.iter().map(|p| p[a]).fold(f64::INFINITY, f64::min)));
        let mut found = Vec::new();
        index.within(&Point3::origin(), 9.0, |i, _| {
            let cell = [2, 1, 0].map(|a| ((cloud[i][a] - low[a]) / 0.3) as usize);
            found.push((cell, i));
        });
        assert_eq!(found.len(), cloud.len());
        assert!(found.is_sorted());
    }

    #[test]
    fn stray_points_do_not_coarsen_an_index_for_nearest_points() {
        let grid =
            (0..10_000).map(|i| Point3::new(0.005 * f64::from(i % 100), 0.005 * f64::from(i / 100), 0.0));
        let mut cloud: Vec<Point3<f64>> = grid.collect();
        let close = GridIndex::for_nearest(&cloud);
        // Four points a cell are two along either side.
        assert!((0.007..0.015).contains(&close.cell_m), "{}", close.cell_m);
        cloud.extend((0..50).map(|i| Point3::new(0.1 * f64::from(i), -20.0, 3.0)));
        let strayed = GridIndex::for_nearest(&cloud);
        assert!((0.007..0.015).contains(&strayed.cell_m), "{}", strayed.cell_m);
    }

    #[test]
    fn an_empty_cloud_has_no_neighbours() {
        let index = GridIndex::new(&[], 1.0);
        assert!(index.nearest(&Point3::origin(), 10.0).is_none());
    }
}
