//! Which parts of an unrolled wall no stone covers.

use nalgebra::Point2;
use serde::Serialize;
use stonewise_core::raster::{LabelImage, connected_components, fill_polygon};

/// Edge of a cell, metres; large walls have larger cells.
const CELL_M: f64 = 0.02;
/// Most cells.
const MAX_CELLS: f64 = 4e7;
/// A place between stones counts as not covered if a square of this edge fits into it, metres: joints are narrower.
const SQUARE_M: f64 = 0.14;

/// A part of the wall without stones.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// Middle along the unrolled wall, metres.
    pub along_m: f64,
    /// Middle up the face, metres.
    pub up_m: f64,
    /// Extent along the wall, metres.
    pub width_m: f64,
    /// Extent up the face, metres.
    pub height_m: f64,
    /// Area, m2.
    pub area_m2: f64,
    /// Share of it in which the cloud has points on the face: there the surface was surveyed, but shows no stone.
    pub share_with_points: f64,
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

    /// Area of the wall, m2, the share of it that stones and the joints between them cover, and the gaps, the largest
    /// first.
    pub fn gaps(&self) -> (f64, f64, Vec<Gap>) {
        let is_wall = self.wall();
        let reach = ((0.5 * SQUARE_M / self.cell_m).round() as usize).max(1);
        let empty: Vec<bool> = { is_wall.iter().zip(&self.is_stone) }
            .map(|(wall, stone)| *wall && !stone)
            .collect();
        // The squares that fit: what is left where stones grow by half a square, grown back.
        let not_empty: Vec<bool> = empty.iter().map(|e| !e).collect();
        let middles: Vec<bool> = self.grown(&not_empty, reach).iter().map(|c| !c).collect();
        let open = self.grown(&middles, reach);
        let cells = is_wall.iter().filter(|w| **w).count();
        let covered = 1.0 - open.iter().filter(|o| **o).count() as f64 / cells.max(1) as f64;
        let labels = open.iter().map(|o| u32::from(*o)).collect();
        let mut gaps: Vec<Gap> = LabelImage::from_vec(self.size[0] as u32, self.size[1] as u32, labels)
            .map(|image| connected_components(&image))
            .map_or_else(Vec::new, |(parts, all)| self.of_parts(parts.data(), all.len()));
        gaps.sort_by(|a, b| b.area_m2.total_cmp(&a.area_m2));
        (cells as f64 * self.cell_m * self.cell_m, covered, gaps)
    }

    /// Cells between stones in their row or in their column.
    fn wall(&self) -> Vec<bool> {
        let [width, height] = self.size;
        let mut is_wall = vec![false; self.is_stone.len()];
        let mut fill = |cells: &mut dyn Iterator<Item = usize>| {
            let cells: Vec<usize> = cells.collect();
            let first = cells.iter().position(|&c| self.is_stone[c]);
            let last = cells.iter().rposition(|&c| self.is_stone[c]);
            if let (Some(first), Some(last)) = (first, last) {
                cells[first..=last].iter().for_each(|&c| is_wall[c] = true);
            }
        };
        (0..height).for_each(|y| fill(&mut (y * width..(y + 1) * width)));
        (0..width).for_each(|x| fill(&mut (x..width * height).step_by(width)));
        is_wall
    }

    /// Cells within a square of this reach around a marked cell, in both directions.
    fn grown(&self, cells: &[bool], reach: usize) -> Vec<bool> {
        let [width, height] = self.size;
        let mut grown = vec![false; cells.len()];
        for y in 0..height {
            spread(cells, &mut grown, y * width, 1, width, reach);
        }
        let rows = grown.clone();
        for x in 0..width {
            spread(&rows, &mut grown, x, width, height, reach);
        }
        grown
    }

    fn of_parts(&self, parts: &[u32], count: usize) -> Vec<Gap> {
        // Smallest and largest cell along and up, cells, cells with points.
        let mut all = vec![[usize::MAX, 0, usize::MAX, 0, 0, 0]; count];
        for (i, &part) in parts.iter().enumerate().filter(|(_, part)| **part > 0) {
            let (x, y) = (i % self.size[0], i / self.size[0]);
            let [x0, x1, y0, y1, cells, seen] = &mut all[part as usize - 1];
            (*x0, *x1, *y0, *y1) = (x.min(*x0), x.max(*x1), y.min(*y0), y.max(*y1));
            *cells += 1;
            *seen += usize::from(self.has_points[i]);
        }
        let middle = |low: usize, high: usize| 0.5 * (low + high + 1) as f64 * self.cell_m;
        let extent = |low: usize, high: usize| (high + 1 - low) as f64 * self.cell_m;
        { all.into_iter() }
            .map(|[x0, x1, y0, y1, cells, seen]| Gap {
                along_m: self.low.x + middle(x0, x1),
                up_m: self.low.y + middle(y0, y1),
                width_m: extent(x0, x1),
                height_m: extent(y0, y1),
                area_m2: cells as f64 * self.cell_m * self.cell_m,
                share_with_points: seen as f64 / cells as f64,
            })
            .collect()
    }
}

/// Marks the cells of one line of `count` cells that lie within `reach` of a marked one.
fn spread(from: &[bool], to: &mut [bool], start: usize, step: usize, count: usize, reach: usize) {
    let mut marked_until = 0;
    for i in 0..count {
        if from[start + i * step] {
            let (begin, end) = (
                i.saturating_sub(reach).max(marked_until),
                (i + reach + 1).min(count),
            );
            (begin..end).for_each(|k| to[start + k * step] = true);
            marked_until = marked_until.max(end);
        }
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
    fn joints_are_covered_and_a_missing_stone_is_a_gap() {
        let (area, covered, gaps) = wall(|_, _| false).gaps();
        assert!((area - 4.18 * 2.18).abs() < 0.1 && covered == 1.0 && gaps.is_empty());

        let mut cover = wall(|i, j| (i, j) == (4, 5));
        // Points in the left half of the gap.
        for k in 0..10_000 {
            let (x, y) = (f64::from(k % 100) * 0.002, f64::from(k / 100) * 0.003);
            cover.add_point(&Point2::new(1.68 + x, 1.09 + y));
        }
        cover.add_point(&Point2::new(-50.0, 3.0));
        let (area, covered, gaps) = cover.gaps();
        let [gap] = gaps.as_slice() else {
            panic!("{gaps:?}")
        };
        // The stone with the joints around it: 0.44 x 0.24 m.
        assert!(
            (gap.along_m - 1.88).abs() < 0.02 && (gap.up_m - 1.2).abs() < 0.02,
            "{gap:?}"
        );
        assert!(
            (gap.width_m - 0.44).abs() < 0.041 && (gap.height_m - 0.24).abs() < 0.041,
            "{gap:?}"
        );
        assert!((gap.share_with_points - 0.5).abs() < 0.1, "{gap:?}");
        assert!((covered - (1.0 - gap.area_m2 / area)).abs() < 1e-9);
    }

    #[test]
    fn what_lies_beside_the_wall_is_no_gap_and_the_largest_gap_comes_first() {
        // Steps: nothing above the diagonal belongs to the wall. A hole of four stones and one of two.
        let (_, _, gaps) =
            wall(|i, j| j > i || ([5, 6].contains(&i) && [1, 2].contains(&j)) || (i == 8 && j == 6)).gaps();
        assert_eq!(gaps.len(), 2, "{gaps:?}");
        assert!(gaps[0].area_m2 > 3.0 * gaps[1].area_m2);
        assert!(Cover::new(&[]).is_none());
    }
}
