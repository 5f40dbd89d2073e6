//! Neighbour search in a cloud of nearly even spacing.

use nalgebra::Point3;

/// Points sorted into cubic cells, for searches within a radius and for nearest neighbours.
///
/// Built once and searched often; a search visits only the cells that its sphere touches. Best where the cell
/// is about as large as the usual search radius. Results come in ascending order of point index within a
/// cell and of cell, so they do not depend on threads.
pub struct GridIndex {
    pub(super) points: Vec<Point3<f64>>,
    /// Index of each sorted point in the input.
    pub(super) order: Vec<u32>,
    /// Start of each cell in `points`; one more entry than cells.
    pub(super) starts: Vec<u32>,
    pub(super) origin: Point3<f64>,
    pub(super) cell_m: f64,
    pub(super) dims: [usize; 3],
}

/// More cells than this are never made; the cell grows instead.
const MAX_CELLS: f64 = 3e7;

impl GridIndex {
    /// Sorts the points into cells of about `cell_m` metres (positive).
    pub fn new(points: &[Point3<f64>], cell_m: f64) -> Self {
        let bounds = crate::geometry::Bounds::of(points.iter().copied());
        let (origin, extent) = bounds.map_or((Point3::origin(), nalgebra::Vector3::zeros()), |b| {
            (b.min, b.max - b.min)
        });
        let mut cell_m = if cell_m > 0.0 { cell_m } else { 1.0 };
        let count = |cell: f64| extent.iter().map(|e| (e / cell).floor() + 1.0).product::<f64>();
        while count(cell_m) > MAX_CELLS {
            cell_m *= 1.26;
        }
        let dims = [0, 1, 2].map(|i| (extent[i] / cell_m).floor() as usize + 1);
        let cell_of = |p: &Point3<f64>| {
            let [i, j, k] = [0, 1, 2].map(|a| (((p[a] - origin[a]) / cell_m) as usize).min(dims[a] - 1));
            (k * dims[1] + j) * dims[0] + i
        };
        let cells: Vec<u32> = points.iter().map(|p| cell_of(p) as u32).collect();
        let mut starts = vec![0u32; dims.iter().product::<usize>() + 1];
        for &c in &cells {
            starts[c as usize + 1] += 1;
        }
        for c in 1..starts.len() {
            starts[c] += starts[c - 1];
        }
        let mut next = starts.clone();
        let mut order = vec![0u32; points.len()];
        for (i, &c) in cells.iter().enumerate() {
            order[next[c as usize] as usize] = i as u32;
            next[c as usize] += 1;
        }
        let points = order.iter().map(|&i| points[i as usize]).collect();
        Self {
            points,
            order,
            starts,
            origin,
            cell_m,
            dims,
        }
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
    pub fn within(&self, centre: &Point3<f64>, radius_m: f64, mut visit: impl FnMut(usize, f64)) {
        let r2 = radius_m * radius_m;
        self.visit_box(centre, radius_m, |slot| {
            let d2 = (self.points[slot] - centre).norm_squared();
            if d2 <= r2 {
                visit(self.order[slot] as usize, d2);
            }
        });
    }

    /// As [`within`](Self::within), with the position in place of the distance.
    pub fn positions_within(
        &self,
        centre: &Point3<f64>,
        radius_m: f64,
        mut visit: impl FnMut(usize, &Point3<f64>),
    ) {
        let r2 = radius_m * radius_m;
        self.visit_box(centre, radius_m, |slot| {
            let p = &self.points[slot];
            if (p - centre).norm_squared() <= r2 {
                visit(self.order[slot] as usize, p);
            }
        });
    }

    /// The nearest point within `max_m`, as (index, squared distance); the lower index wins a tie.
    pub fn nearest(&self, centre: &Point3<f64>, max_m: f64) -> Option<(usize, f64)> {
        self.nearest_k(centre, 1, max_m).first().copied()
    }

    /// The `k` nearest points within `max_m`, nearest first, as (index, squared distance).
    pub fn nearest_k(&self, centre: &Point3<f64>, k: usize, max_m: f64) -> Vec<(usize, f64)> {
        let mut radius = self.cell_m.min(max_m);
        loop {
            let mut found = Vec::new();
            self.within(centre, radius, |i, d2| found.push((i, d2)));
            if found.len() >= k || radius >= max_m {
                found.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
                found.truncate(k);
                return found;
            }
            radius = (radius * 2.0).min(max_m);
        }
    }

    fn visit_box(&self, centre: &Point3<f64>, radius_m: f64, mut visit: impl FnMut(usize)) {
        if self.points.is_empty() {
            return;
        }
        let mut low = [0usize; 3];
        let mut high = [0usize; 3];
        for a in 0..3 {
            let from = ((centre[a] - radius_m - self.origin[a]) / self.cell_m).floor();
            let to = ((centre[a] + radius_m - self.origin[a]) / self.cell_m).floor();
            if to < 0.0 || from >= self.dims[a] as f64 {
                return;
            }
            low[a] = from.max(0.0) as usize;
            high[a] = (to as usize).min(self.dims[a] - 1);
        }
        for k in low[2]..=high[2] {
            for j in low[1]..=high[1] {
                let row = (k * self.dims[1] + j) * self.dims[0];
                let (start, end) = (
                    self.starts[row + low[0]] as usize,
                    self.starts[row + high[0] + 1] as usize,
                );
                (start..end).for_each(&mut visit);
            }
        }
    }
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

    #[test]
    fn radius_and_nearest_agree_with_brute_force() {
        for cloud in clouds() {
            let index = GridIndex::new(&cloud, 0.3);
            for centre in cloud
                .iter()
                .step_by(17)
                .chain([&Point3::new(20.0, 0.0, 0.0), &Point3::new(0.1, -2.0, 0.3)])
            {
                for radius in [0.05, 0.31, 2.0] {
                    let mut found = Vec::new();
                    index.within(centre, radius, |i, _| found.push(i));
                    found.sort_unstable();
                    let expected: Vec<usize> = (0..cloud.len())
                        .filter(|&i| (cloud[i] - centre).norm_squared() <= radius * radius)
                        .collect();
                    assert_eq!(found, expected);
                }
                let mut expected: Vec<(usize, f64)> = cloud
                    .iter()
                    .enumerate()
                    .map(|(i, p)| (i, (p - centre).norm_squared()))
                    .collect();
                expected.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
                expected.truncate(5);
                assert_eq!(index.nearest_k(centre, 5, 1e3), expected);
            }
        }
    }

    #[test]
    fn an_empty_cloud_has_no_neighbours() {
        let index = GridIndex::new(&[], 1.0);
        assert!(index.nearest(&Point3::origin(), 10.0).is_none());
    }
}
