//! Panels: masks that are fields of a door, a shutter or a grille instead of stones.
//!
//! The detector was trained on stones and reports framed fields as such. Two things together tell them apart: what
//! was made in one piece stands back from the masonry all around it, and its fields have the same relief, while no
//! two stones are alike. Neither is enough: walls have niches, and some ashlar was dressed to a pattern.

use crate::cloud::GridIndex;
use crate::components::components;
use crate::geometry::{Bounds, FaceFrame};
use crate::id::StoneId;
use crate::stone::Stone;
use nalgebra::{DMatrix, DVector, Matrix3, Point3, Vector3};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Side of a cell of a relief, metres: finer than the edges of panels, and a cell still holds some points.
const CELL_M: f64 = 0.01;
/// Cells on each side of the middle: 15 cm, the half of a panel.
const HALF: i32 = 15;
/// Cells that a relief needs: those of a face of 8 cm.
const LEAST_CELLS: usize = 60;
/// Shifts by which two reliefs are compared, cells: masks of the same panel are cut differently.
const SHIFTS: i32 = 3;
/// Share of the smaller relief that must overlap.
const LEAST_OVERLAP: f64 = 0.6;
/// Nearest stones with which a stone is compared.
const NEIGHBOURS: usize = 12;
/// Correlation from which on two reliefs are alike, and how many others must be like a stone.
const ALIKE: f64 = 0.6;
const LIKE_OTHERS: usize = 3;
/// Share of the fields of one leaf that are like others; of them many are cut off by the frame or by a mask.
const REPEATED: f64 = 0.5;
/// Stones that lie in one plane belong together if they are nearer than this, metres, turned by less than 10
/// degrees, and no farther out of each other's plane than the third, metres.
const TOGETHER_M: f64 = 0.75;
const SAME_TURN: f64 = 0.985;
const SAME_PLANE_M: f64 = 0.03;
/// Fewer fields are no leaf.
const LEAST_FIELDS: usize = 6;
/// Share of the stones around a leaf, and least number of them, that stand in front of it.
const IN_FRONT: f64 = 0.9;
const LEAST_AROUND: usize = 4;

/// The relief of each stone of an epoch, as its points are added.
#[derive(Clone, Debug)]
pub struct StoneReliefs(BTreeMap<u32, Relief>);

#[derive(Clone, Debug)]
struct Relief {
    centroid: Point3<f64>,
    face_from_world: Matrix3<f64>,
    /// Per cell, row by row from the lower left: sum of heights and number of points.
    sums: Vec<(f32, u32)>,
}

impl StoneReliefs {
    /// The reliefs of stones whose points are not yet added.
    pub fn new(stones: &[Stone]) -> Self {
        let relief = |stone: &Stone| Relief {
            centroid: stone.centroid,
            face_from_world: FaceFrame::from_normal(&stone.normal).face_from_world(),
            sums: vec![(0.0, 0); (4 * HALF * HALF) as usize],
        };
        Self(stones.iter().map(|s| (s.id.0, relief(s))).collect())
    }

    /// Adds a point with the label of a stone.
    pub fn add(&mut self, stone: u32, point: &Point3<f64>) {
        let Some(relief) = self.0.get_mut(&stone) else {
            return;
        };
        let local = relief.face_from_world * (point - relief.centroid);
        let [x, y] = [local.x, local.y].map(|v| (v / CELL_M).floor() as i32 + HALF);
        if (0..2 * HALF).contains(&x) && (0..2 * HALF).contains(&y) {
            let sum = &mut relief.sums[(y * 2 * HALF + x) as usize];
            sum.0 += local.z as f32;
            sum.1 += 1;
        }
    }
}

/// The stones that are panels, ascending.
pub fn panels(stones: &[Stone], reliefs: &StoneReliefs) -> Vec<StoneId> {
    let places: Vec<Point3<f64>> = stones.iter().map(|s| s.centroid).collect();
    let Some(bounds) = Bounds::of(places.iter().copied()) else {
        return Vec::new();
    };
    let index = GridIndex::for_nearest(&places);
    let extent_m = (bounds.max - bounds.min).norm();
    let near: Vec<Vec<usize>> = (0..stones.len())
        .into_par_iter()
        .map(|i| {
            let found = index.nearest_k(&places[i], NEIGHBOURS + 1, extent_m);
            found.into_iter().map(|(j, _)| j).filter(|j| *j != i).collect()
        })
        .collect();
    let mut found: Vec<StoneId> = leaves(stones, &near)
        .into_iter()
        .map(|leaf| with_rim(stones, &index, &leaf))
        .filter(|leaf| stands_back(stones, &index, leaf) && repeats(stones, reliefs, &near, leaf))
        .flatten()
        .map(|i| stones[i].id)
        .collect();
    found.sort_unstable();
    found
}

/// Groups of stones in one plane.
fn leaves(stones: &[Stone], near: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let is_joined = |i: usize, j: usize| {
        let (a, b) = (&stones[i], &stones[j]);
        let apart = b.centroid - a.centroid;
        apart.norm() < TOGETHER_M
            && a.normal.dot(&b.normal) > SAME_TURN
            && apart.dot(&a.normal).abs().max(apart.dot(&b.normal).abs()) < SAME_PLANE_M
    };
    let mut next: Vec<Vec<usize>> = vec![Vec::new(); stones.len()];
    for (i, near) in near.iter().enumerate() {
        for &j in near.iter().filter(|j| is_joined(i, **j)) {
            next[i].push(j);
            next[j].push(i);
        }
    }
    let mut leaves = components(next.len(), |stone| next[stone].iter().copied());
    leaves.retain(|leaf| leaf.len() >= LEAST_FIELDS);
    leaves
}

/// A group with the stones beside it in its plane, whose own normals are turned by the reveal around a leaf;
/// ascending.
fn with_rim(stones: &[Stone], index: &GridIndex, leaf: &[usize]) -> Vec<usize> {
    let (centre, out) = plane(stones, leaf);
    let mut all: BTreeSet<usize> = leaf.iter().copied().collect();
    for &i in leaf {
        index.within(&stones[i].centroid, TOGETHER_M, |j, _| {
            if (stones[j].centroid - centre).dot(&out).abs() < SAME_PLANE_M {
                all.insert(j);
            }
        });
    }
    all.into_iter().collect()
}

/// Middle and normal of a group.
fn plane(stones: &[Stone], leaf: &[usize]) -> (Point3<f64>, Vector3<f64>) {
    let sum =
        |of: &dyn Fn(&Stone) -> Vector3<f64>| -> Vector3<f64> { leaf.iter().map(|&i| of(&stones[i])).sum() };
    let centre = sum(&|s| s.centroid.coords) / leaf.len().max(1) as f64;
    (Point3::from(centre), sum(&|s| s.normal).normalize())
}

/// Whether a group lies behind nearly all stones around it.
fn stands_back(stones: &[Stone], index: &GridIndex, leaf: &[usize]) -> bool {
    let mut in_front: BTreeMap<usize, bool> = BTreeMap::new();
    let (_, out_of_leaf) = plane(stones, leaf);
    for &i in leaf {
        let here = &stones[i];
        index.within(&here.centroid, TOGETHER_M, |j, _| {
            let out = (stones[j].centroid - here.centroid).dot(&out_of_leaf);
            let is_front = in_front.entry(j).or_insert(true);
            *is_front &= out > SAME_PLANE_M;
        });
    }
    leaf.iter().for_each(|i| {
        in_front.remove(i);
    });
    let front = in_front.values().filter(|f| **f).count();
    in_front.len() >= LEAST_AROUND && front as f64 >= IN_FRONT * in_front.len() as f64
}

/// Whether most of a group have the relief of others of it.
fn repeats(stones: &[Stone], reliefs: &StoneReliefs, near: &[Vec<usize>], leaf: &[usize]) -> bool {
    let shapes: BTreeMap<usize, Shape> = leaf
        .iter()
        .filter_map(|&i| Some((i, Shape::of(reliefs.0.get(&stones[i].id.0)?)?)))
        .collect();
    let is_like_others = |(i, shape): (&usize, &Shape)| {
        let others = near[*i].iter().filter_map(|j| shapes.get(j));
        others.filter(|other| shape.likeness(other) >= ALIKE).count() >= LIKE_OTHERS
    };
    let all: Vec<(&usize, &Shape)> = shapes.iter().collect();
    let alike = all.into_par_iter().filter(|s| is_like_others(*s)).count();
    shapes.len() >= LEAST_FIELDS && alike as f64 >= REPEATED * shapes.len() as f64
}

/// A relief less the curved surface that fits it best: what is left of two pillow-shaped stones is not alike.
struct Shape {
    /// Per cell; NaN where it has no points.
    heights: Vec<f32>,
    cells: usize,
}

impl Shape {
    fn of(relief: &Relief) -> Option<Self> {
        let side = 2 * HALF;
        let cells: Vec<(i32, f64)> = (0..)
            .zip(&relief.sums)
            .filter(|(_, (_, n))| *n > 0)
            .map(|(cell, (sum, n))| (cell, f64::from(*sum) / f64::from(*n)))
            .collect();
        if cells.len() < LEAST_CELLS {
            return None;
        }
        let terms = |cell: i32| {
            let [x, y] = [cell % side, cell / side].map(|k| f64::from(k - HALF) / f64::from(HALF));
            [1.0, x, y, x * x, x * y, y * y]
        };
        let design = DMatrix::from_fn(cells.len(), 6, |r, c| terms(cells[r].0)[c]);
        let values = DVector::from_iterator(cells.len(), cells.iter().map(|c| c.1));
        let normal = design.tr_mul(&design);
        let fitted = &design * normal.cholesky()?.solve(&design.tr_mul(&values));
        let mut heights = vec![f32::NAN; relief.sums.len()];
        for (k, (cell, value)) in cells.iter().enumerate() {
            heights[*cell as usize] = (value - fitted[k]) as f32;
        }
        Some(Self {
            heights,
            cells: cells.len(),
        })
    }

    /// The largest correlation with another over small shifts; zero where too little of them overlaps.
    fn likeness(&self, other: &Self) -> f64 {
        let least = (LEAST_OVERLAP * self.cells.min(other.cells) as f64).max(LEAST_CELLS as f64);
        let mut best = 0.0;
        for dy in -SHIFTS..=SHIFTS {
            for dx in -SHIFTS..=SHIFTS {
                best = f64::max(best, self.correlation(other, [dx, dy], least).unwrap_or(0.0));
            }
        }
        best
    }

    /// Correlation where the other is shifted by this many cells.
    fn correlation(&self, other: &Self, [dx, dy]: [i32; 2], least: f64) -> Option<f64> {
        let side = 2 * HALF;
        let mut sums = Vector3::<f64>::zeros();
        let mut count = 0.0;
        for y in dy.max(0)..side + dy.min(0) {
            for x in dx.max(0)..side + dx.min(0) {
                let a = f64::from(self.heights[(y * side + x) as usize]);
                let b = f64::from(other.heights[((y - dy) * side + x - dx) as usize]);
                if (a + b).is_finite() {
                    sums += Vector3::new(a * b, a * a, b * b);
                    count += 1.0;
                }
            }
        }
        (count >= least && sums.y > 0.0 && sums.z > 0.0).then(|| sums.x / (sums.y * sums.z).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::split_mix;

    /// Relief of a panel: a field within a frame; of a stone: bosses of its own.
    fn height(k: u32, is_panel: bool, y: f64, z: f64) -> f64 {
        if is_panel {
            return 0.008 * f64::from(u8::from(y.abs().max(z.abs()) < 0.06));
        }
        let [i, j] = [y, z].map(|v| ((v + 0.1) / 0.03).floor() as u64);
        0.008 * (split_mix((u64::from(k) << 16) + (i << 8) + j) as f64 / u64::MAX as f64)
    }

    /// A wall of 10 x 10 stones of 20 cm in the plane x = 0, in which the middle 16 stand `back` metres behind the
    /// plane, and the panels found in it.
    fn found(back: f64, is_panel: bool) -> Vec<StoneId> {
        let is_middle = |k: u32| (3..7).contains(&(k % 10)) && (3..7).contains(&(k / 10));
        let stone = |k: u32| Stone {
            id: StoneId(k + 1),
            centroid: Point3::new(
                if is_middle(k) { -back } else { 0.0 },
                0.2 * f64::from(k % 10),
                0.2 * f64::from(k / 10),
            ),
            normal: Vector3::x(),
            area_m2: 0.04,
            points: 400,
            photos: 3,
            confidence: 0.9,
        };
        let stones: Vec<Stone> = (0..100).map(stone).collect();
        let mut reliefs = StoneReliefs::new(&stones);
        for (k, stone) in (0..).zip(&stones) {
            for cell in 0..1296 {
                let [y, z] = [cell % 36, cell / 36].map(|c| (f64::from(c) - 17.5) * 0.005);
                let x = height(k, is_panel && is_middle(k), y, z);
                reliefs.add(stone.id.0, &(stone.centroid + Vector3::new(x, y, z)));
            }
        }
        panels(&stones, &reliefs)
    }

    #[test]
    fn alike_fields_that_stand_back_are_panels_and_a_niche_or_a_pattern_is_none() {
        assert_eq!(found(0.2, true).len(), 16);
        assert!(found(0.2, false).is_empty());
        assert!(found(0.0, true).is_empty());
        assert!(panels(&[], &StoneReliefs::new(&[])).is_empty());
    }
}
