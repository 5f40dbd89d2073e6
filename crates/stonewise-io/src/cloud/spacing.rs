//! How far points lie from their nearest neighbours.

use std::collections::HashMap;

use nalgebra::Point3;
use stonewise_core::geometry::cell_of;
use stonewise_core::statistics::upper_median;

/// Sizes of the cells that are looked at, metres: each is kept with all of its points, or not at all.
const CELLS_M: [f64; 3] = [0.05, 0.5, 8.0];
/// Points that are kept of each size.
const MOST_POINTS: usize = 100_000;
/// Points that are looked at: of those of a surface about a quarter lie inside.
const LOOKS: usize = 20_000;
/// Points nearer than this to the border of their cell, as a share of its size, are not searched from: their
/// neighbours may lie beyond it.
const MARGIN: f64 = 0.25;

/// Clouds of fewer points are kept whole.
const FEW_POINTS: usize = 5000;

/// The points of a small cloud, and samples of whole cells of a large one, chosen by their place alone.
pub(super) struct Spacing {
    samples: Vec<Sample>,
    /// `None` once there are too many.
    few: Option<Vec<Point3<f64>>>,
}

struct Sample {
    cell_m: f64,
    cells: HashMap<[i64; 3], Vec<Point3<f64>>>,
    points: usize,
    /// Cells whose number is not larger are kept.
    limit: u64,
}

impl Spacing {
    pub fn new() -> Self {
        let sample = |cell_m| Sample {
            cell_m,
            cells: HashMap::new(),
            points: 0,
            limit: u64::MAX,
        };
        Self {
            samples: CELLS_M.map(sample).into(),
            few: Some(Vec::new()),
        }
    }

    pub fn add(&mut self, points: &[Point3<f64>]) {
        if let Some(few) = &mut self.few {
            few.extend_from_slice(points);
        }
        self.few.take_if(|few| few.len() > FEW_POINTS);
        for sample in &mut self.samples {
            points.iter().for_each(|p| sample.add(p));
        }
    }

    /// Median distance from a point to the nearest other one, metres; points at the same place are one.
    pub fn median_m(&self) -> Option<f64> {
        if let Some(few) = &self.few {
            return median_of_all(few);
        }
        let found: Vec<(f64, usize, usize)> = self.samples.iter().filter_map(Sample::median_m).collect();
        // In the smallest cells many neighbours are hidden by the border, unless the cloud is dense.
        let trusted = found
            .iter()
            .find(|(_, found, searched)| found * 100 > searched * 95);
        trusted.or(found.last()).map(|(median, _, _)| *median)
    }
}

impl Sample {
    fn add(&mut self, p: &Point3<f64>) {
        let cell = cell_of(p, self.cell_m);
        if number_of(&cell) > self.limit {
            return;
        }
        self.cells.entry(cell).or_default().push(*p);
        self.points += 1;
        while self.points > MOST_POINTS {
            self.limit /= 2;
            let limit = self.limit;
            self.cells.retain(|cell, _| number_of(cell) <= limit);
            self.points = self.cells.values().map(Vec::len).sum();
        }
    }

    /// The median, and how many searches found a neighbour within the margin, of how many.
    fn median_m(&self) -> Option<(f64, usize, usize)> {
        let mut cells: Vec<(&[i64; 3], &Vec<Point3<f64>>)> = self.cells.iter().collect();
        cells.sort_unstable_by_key(|(cell, _)| **cell);
        let step = self.points.div_ceil(LOOKS).max(1);
        let (mut distances, mut searched, mut next) = (Vec::new(), 0, 0);
        for (cell, points) in cells {
            let mut sorted = points.clone();
            sorted.sort_unstable_by(|a, b| a.x.total_cmp(&b.x));
            while next < sorted.len() {
                let p = sorted[next];
                let is_inside = (0..3).all(|axis| {
                    let low = cell[axis] as f64 * self.cell_m;
                    (p[axis] - low).min(low + self.cell_m - p[axis]) >= MARGIN * self.cell_m
                });
                if is_inside {
                    searched += 1;
                    let nearest = nearest_m(&sorted, next);
                    distances.extend((nearest <= MARGIN * self.cell_m).then_some(nearest));
                }
                next += step;
            }
            next -= sorted.len();
        }
        Some((upper_median(&mut distances)?, distances.len(), searched))
    }
}

/// The median of the distances of all points.
fn median_of_all(points: &[Point3<f64>]) -> Option<f64> {
    let mut sorted = points.to_vec();
    sorted.sort_unstable_by(|a, b| a.x.total_cmp(&b.x));
    let distances = (0..sorted.len()).map(|of| nearest_m(&sorted, of));
    let mut distances: Vec<f64> = distances.filter(|d| d.is_finite()).collect();
    upper_median(&mut distances)
}

/// Distance of a point to the nearest other one, of points in order of x.
fn nearest_m(sorted: &[Point3<f64>], of: usize) -> f64 {
    let p = sorted[of];
    let mut nearest = f64::INFINITY;
    let mut look = |q: &Point3<f64>| {
        let distance = (q - p).norm();
        if distance > 0.0 && distance < nearest {
            nearest = distance;
        }
        (q.x - p.x).abs() < nearest
    };
    let _ = sorted[of + 1..].iter().all(&mut look);
    let _ = sorted[..of].iter().rev().all(&mut look);
    nearest
}

/// A hash of a cell, independent of its place (Steele et al. 2014, SplitMix).
fn number_of(cell: &[i64; 3]) -> u64 {
    cell.iter().fold(0, |hash, &c| {
        let mut z = (hash ^ c.cast_unsigned()).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spacing_of_grids_is_found() {
        for step in [0.002, 0.013, 0.21, 1.7] {
            let side = if step < 0.01 { 700 } else { 200 };
            let mut spacing = Spacing::new();
            for row in 0..side {
                // Rows are farther apart than the points in them.
                let at = |k| Point3::new(3e5 + f64::from(k) * step, f64::from(row) * 1.5 * step, 2.23);
                let points: Vec<Point3<f64>> = (0..side).map(at).collect();
                spacing.add(&points);
            }
            let found = spacing.median_m().unwrap();
            assert!((found / step - 1.0).abs() < 1e-6, "{step}: {found}");
        }
        let mut spacing = Spacing::new();
        assert_eq!(spacing.median_m(), None);
        spacing.add(&[0.0, 1.0, 1.5, 9.0].map(|x| Point3::new(x, 0.0, 0.0)));
        // 1, 0.5, 0.5 and 7.5.
        assert_eq!(spacing.median_m(), Some(1.0));
    }

    /// Of points strewn at random over a plane, n to the square metre, half have a neighbour within
    /// sqrt(ln 2 / (pi n)).
    #[test]
    fn the_spacing_of_strewn_points_is_that_of_a_poisson_process() {
        let mut state = 1u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for (side_m, n) in [(20.0, 400.0), (2.0, 40_000.0)] {
            let mut spacing = Spacing::new();
            for _ in 0..160_000 {
                spacing.add(&[Point3::new(side_m * random(), 2.23, side_m * random())]);
            }
            let expected = (std::f64::consts::LN_2 / (std::f64::consts::PI * n)).sqrt();
            let found = spacing.median_m().unwrap();
            assert!((found / expected - 1.0).abs() < 0.05, "{found} and {expected}");
        }
    }
}
