//! How much of an unrolled wall stones cover.

use nalgebra::Point2;
use serde::Serialize;
use std::iter::StepBy;
use std::ops::Range;
use stonewise_core::raster::{closed, fill_polygon};

/// Edge of a cell, metres; large walls have larger cells.
const CELL_M: f64 = 0.02;
/// Most cells.
const MAX_CELLS: f64 = 4e7;
/// A place between stones counts as not covered if a square of this edge fits into it, metres: joints are narrower.
const SQUARE_M: f64 = 0.14;

/// How much of the face between the outermost stones is covered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Coverage {
    /// Area of that face, m2.
    pub face_m2: f64,
    /// Share of it that stones and the joints between them cover.
    pub covered: f64,
    /// Share of it without stones in which the cloud has points on the face: there the surface was surveyed, but shows no
    /// stone. Nothing was surveyed of the rest.
    pub without_stones: f64,
}

/// The unrolled wall in cells: those within the outlines of stones, and those with points of the cloud.
///
/// A cell belongs to the wall if stones lie to its left and right, or above and below.
pub struct Cover {
    low: Point2<f64>,
    cell_m: f64,
    size: [usize; 2],
    is_stone: Vec<bool>,
    has_points: Vec<bool>,
}

impl Cover {
    /// The cells of stones with these outlines, metres along the wall and up its face; `None` without any outline.
    pub fn new(rings: &[Vec<Point2<f64>>]) -> Option<Self> {
        let is_finite = |p: &&Point2<f64>| p.x.is_finite() && p.y.is_finite();
        let corners = || rings.iter().flatten().filter(is_finite).copied();
        let (low, high) = (
            corners().reduce(|a, b| a.inf(&b))?,
            corners().reduce(|a, b| a.sup(&b))?,
        );
        let extent = high - low;
        let cell_m = CELL_M.max((extent.x * extent.y / MAX_CELLS).sqrt());
        let size = [extent.x, extent.y].map(|v| (v / cell_m).ceil().max(1.0) as usize);
        let mut is_stone = vec![false; size[0] * size[1]];

        for ring in rings {
            let ring = ring.iter().map(|p| ((p - low) / cell_m).into()).collect();
            fill_polygon(&[ring], size[0] as u32, size[1] as u32, |y, begin, end| {
                let row = y as usize * size[0];
                is_stone[row + begin as usize..row + end as usize].fill(true);
            });
        }

        Some(Self {
            low,
            cell_m,
            size,
            has_points: vec![false; is_stone.len()],
            is_stone,
        })
    }

    /// Notes that the cloud has a point on the face at this place of the unrolled wall.
    pub fn add_point(&mut self, place: &Point2<f64>) {
        let at = (place - self.low) / self.cell_m;
        let is_inside = |axis: usize| (0.0..self.size[axis] as f64).contains(&at[axis]);
        if is_inside(0) && is_inside(1) {
            self.has_points[at.y as usize * self.size[0] + at.x as usize] = true;
        }
    }

    /// How much of the wall is covered.
    pub fn coverage(&self) -> Coverage {
        let is_wall = self.wall();
        let reach = ((0.5 * SQUARE_M / self.cell_m).round() as usize).max(1);
        let not_empty: Vec<bool> = is_wall
            .iter()
            .zip(&self.is_stone)
            .map(|(wall, stone)| !wall || *stone)
            .collect();
        let covered = closed(&not_empty, self.size[0], self.size[1], reach);
        let cells = is_wall.iter().filter(|w| **w).count();
        let share = |keep: &dyn Fn(usize) -> bool| {
            (0..covered.len()).filter(|&i| !covered[i] && keep(i)).count() as f64 / cells.max(1) as f64
        };
        Coverage {
            face_m2: cells as f64 * self.cell_m * self.cell_m,
            covered: 1.0 - share(&|_| true),
            without_stones: share(&|i| self.has_points[i]),
        }
    }

    fn rows(&self) -> impl Iterator<Item = StepBy<Range<usize>>> {
        let [width, height] = self.size;
        (0..height).map(move |y| (y * width..(y + 1) * width).step_by(1))
    }

    fn columns(&self) -> impl Iterator<Item = StepBy<Range<usize>>> {
        let [width, height] = self.size;
        (0..width).map(move |x| (x..width * height).step_by(width))
    }

    /// Cells between stones in their row or in their column.
    fn wall(&self) -> Vec<bool> {
        let mut is_wall = vec![false; self.is_stone.len()];
        for line in self.rows().chain(self.columns()) {
            let is_stone = |&cell: &usize| self.is_stone[cell];
            if let (Some(first), Some(last)) = (line.clone().find(is_stone), line.clone().rfind(is_stone)) {
                line.filter(|cell| (first..=last).contains(cell))
                    .for_each(|cell| is_wall[cell] = true);
            }
        }
        is_wall
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(x: [f64; 2], y: [f64; 2]) -> Vec<Point2<f64>> {
        let corners = [(0, 0), (1, 0), (1, 1), (0, 1)];
        corners.map(|(i, j)| Point2::new(x[i], y[j])).into()
    }

    /// Stones of 0.4 x 0.2 m with joints of 2 cm, without those for which `is_missing`.
    fn wall(is_missing: fn(usize, usize) -> bool) -> Cover {
        let rings: Vec<_> = (0..10)
            .flat_map(|i| (0..10).map(move |j| (i, j)))
            .filter(|&(i, j)| !is_missing(i, j))
            .map(|(i, j)| (0.42 * i as f64, 0.22 * j as f64))
            .map(|(x, y)| rectangle([x, x + 0.4], [y, y + 0.2]))
            .collect();
        Cover::new(&rings).unwrap()
    }

    #[test]
    fn joints_are_covered_and_a_missing_stone_is_not() {
        let whole = wall(|_, _| false).coverage();
        assert!((whole.face_m2 - 4.18 * 2.18).abs() < 0.1 && whole.covered == 1.0);

        let mut cover = wall(|i, j| (i, j) == (4, 5));
        // Points in the left half of the gap.
        for k in 0..10_000 {
            let (x, y) = (f64::from(k % 100) * 0.002, f64::from(k / 100) * 0.003);
            cover.add_point(&Point2::new(1.68 + x, 1.09 + y));
        }
        cover.add_point(&Point2::new(-50.0, 3.0));
        let found = cover.coverage();
        // The stone with the joints around it: 0.44 x 0.24 m.
        let open = 1.0 - found.covered;
        assert!((open * found.face_m2 - 0.44 * 0.24).abs() < 0.03, "{found:?}");
        assert!((found.without_stones / open - 0.5).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn what_lies_beside_the_wall_is_no_gap() {
        // Steps: nothing above the diagonal belongs to the wall. A hole of four stones.
        let found = wall(|i, j| j > i || ([5, 6].contains(&i) && [1, 2].contains(&j))).coverage();
        assert!(found.covered > 0.85 && found.covered < 0.98, "{found:?}");
        assert!(Cover::new(&[]).is_none());
    }
}
