//! The face of a stone as its cloud shows it: the grid on which photos are compared.

use super::blur::blur;
use super::params::PhotoParams;
use crate::registration::points::PairPoints;
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeSet;

/// Cells in which a face shows itself by its points, metres: some points of a sparse drone cloud in each.
const FACE_CELL_M: f64 = 0.02;
/// Cells of the height map, metres: finer than the relief that parallax can show.
const HEIGHT_CELL_M: f64 = 0.01;
/// Noise that the smoothed heights may keep, metres: a parallax of 0.3 makes a tenth of a pixel of it.
const HEIGHT_NOISE_M: f64 = 0.001;
/// Reach over which heights are smoothed, metres: least (dense scans) and most (a third of a stone).
const SMOOTHING_M: [f64; 2] = [0.008, 0.05];
/// Most cells along a side of the grid: larger stones are sampled more coarsely, as they have texture enough.
const MOST_CELLS: f64 = 240.0;
/// Points that determine a plane with some redundancy.
const LEAST_POINTS: usize = 12;

/// The grid of a stone's face, with a margin around it.
pub(crate) struct Surface {
    /// Edge of a cell, metres.
    pub cell_m: f64,
    pub columns: usize,
    pub rows: usize,
    /// Place of the middle of the first cell: along, up; metres from the stone's centroid.
    pub first: [f64; 2],
    /// Height of the face at every cell, metres.
    pub heights: Vec<f64>,
    /// Cells of the face without its rim.
    pub inside: Vec<bool>,
    /// Middle of those cells: along, up, metres.
    pub middle: [f64; 2],
}

impl Surface {
    /// The surface of the points of the first epoch; `face_from_world`: the stone's frame. `None` where nothing of the
    /// face is left within the rim.
    pub fn new(
        pair: &PairPoints,
        face_from_world: &Matrix3<f64>,
        pixel_m: f64,
        margin_m: f64,
        params: &PhotoParams,
    ) -> Option<Self> {
        let points = local_points(pair, face_from_world);
        let shape = HeightMap::new(&points)?;
        let face: BTreeSet<[i64; 2]> = points.iter().map(|p| face_cell(p.x, p.y)).collect();
        let (low, high) = bounds(&points)?;
        let side = (0..2).map(|a| high[a] - low[a]).fold(0.0, f64::max) + 2.0 * margin_m;
        let cell_m = pixel_m.max(side / MOST_CELLS);
        let count = |a: usize| ((high[a] - low[a] + 2.0 * margin_m) / cell_m).ceil().max(1.0) as usize;
        let (columns, rows) = (count(0), count(1));
        let first = [low[0] - margin_m + 0.5 * cell_m, low[1] - margin_m + 0.5 * cell_m];
        let mut surface = Self {
            cell_m,
            columns,
            rows,
            first,
            heights: Vec::with_capacity(columns * rows),
            inside: Vec::with_capacity(columns * rows),
            middle: [0.0; 2],
        };

        for k in 0..columns * rows {
            let [u, v] = surface.place(k);
            surface.heights.push(shape.at(u, v));
            surface.inside.push(is_inside(&face, u, v, params.rim_m));
        }

        surface.centre()?;
        Some(surface)
    }

    /// A flat square face of `side` cells of 3 mm, of which a rim of `rim` cells is left out.
    #[cfg(test)]
    pub fn flat(side: usize, rim: usize) -> Self {
        let inside = |k: usize| {
            let (c, r) = (k % side, k / side);
            (rim..side - rim).contains(&c) && (rim..side - rim).contains(&r)
        };
        Self {
            cell_m: 0.003,
            columns: side,
            rows: side,
            first: [0.0; 2],
            heights: vec![0.0; side * side],
            inside: (0..side * side).map(inside).collect(),
            middle: [0.0015 * (side - 1) as f64; 2],
        }
    }

    /// Place of a cell's middle: along, up, metres.
    pub fn place(&self, k: usize) -> [f64; 2] {
        [
            self.first[0] + (k % self.columns) as f64 * self.cell_m,
            self.first[1] + (k / self.columns) as f64 * self.cell_m,
        ]
    }

    /// The cell that holds a place; `None` outside.
    pub fn cell_at(&self, place: [f64; 2]) -> Option<usize> {
        let [column, row] = [0, 1].map(|axis| ((place[axis] - self.first[axis]) / self.cell_m).round());
        let is_on = |v: f64, size: usize| v >= 0.0 && v < size as f64;
        (is_on(column, self.columns) && is_on(row, self.rows))
            .then(|| row as usize * self.columns + column as usize)
    }

    fn centre(&mut self) -> Option<()> {
        let places: Vec<[f64; 2]> = (0..self.inside.len())
            .filter(|&k| self.inside[k])
            .map(|k| self.place(k))
            .collect();
        let count = places.len() as f64;
        if places.is_empty() {
            return None;
        }
        let mean = |value: &dyn Fn(&[f64; 2]) -> f64| places.iter().map(value).sum::<f64>() / count;
        self.middle = std::array::from_fn(|a| mean(&|p| p[a]));
        Some(())
    }
}

/// Points of the first epoch in the stone's frame, metres from its centroid.
fn local_points(pair: &PairPoints, face_from_world: &Matrix3<f64>) -> Vec<Vector3<f64>> {
    let cloud = &pair.points_first;
    (0..cloud.len())
        .map(|i| face_from_world * (cloud.world(i) - pair.centroid))
        .collect()
}

/// Lowest and highest corner of a stone's points in its frame: along, up.
pub(crate) fn bounds(points: &[Vector3<f64>]) -> Option<([f64; 2], [f64; 2])> {
    let corner = |pick: fn(f64, f64) -> f64, start: f64| {
        points
            .iter()
            .fold([start; 2], |c, p| [pick(c[0], p.x), pick(c[1], p.y)])
    };
    let (low, high) = (
        corner(f64::min, f64::INFINITY),
        corner(f64::max, f64::NEG_INFINITY),
    );
    (low[0] < high[0] && low[1] < high[1]).then_some((low, high))
}

fn face_cell(u: f64, v: f64) -> [i64; 2] {
    [(u / FACE_CELL_M).floor() as i64, (v / FACE_CELL_M).floor() as i64]
}

/// Whether points lie all around a place, as far away as the rim is wide.
fn is_inside(face: &BTreeSet<[i64; 2]>, u: f64, v: f64, rim_m: f64) -> bool {
    let d = rim_m * std::f64::consts::FRAC_1_SQRT_2;
    let around = [
        [0.0, 0.0],
        [rim_m, 0.0],
        [-rim_m, 0.0],
        [0.0, rim_m],
        [0.0, -rim_m],
        [d, d],
        [d, -d],
        [-d, d],
        [-d, -d],
    ];
    around
        .iter()
        .all(|[du, dv]| face.contains(&face_cell(u + du, v + dv)))
}

/// A plane, and smoothed heights above it.
struct HeightMap {
    plane: Vector3<f64>,
    low: [f64; 2],
    columns: usize,
    rows: usize,
    heights: Vec<f32>,
}

impl HeightMap {
    fn new(points: &[Vector3<f64>]) -> Option<Self> {
        let plane = fit_plane(points)?;
        let (low, high) = bounds(points)?;
        let above = |p: &Vector3<f64>| p.z - plane.x - plane.y * p.x - plane.z * p.y;
        let count = |a: usize| ((high[a] - low[a]) / HEIGHT_CELL_M) as usize + 2;
        let (columns, rows) = (count(0), count(1));
        let (mut sums, mut weights) = (vec![0.0; columns * rows], vec![0.0; columns * rows]);
        let mut square = 0.0;

        for p in points {
            let column = ((p.x - low[0]) / HEIGHT_CELL_M).round() as usize;
            let row = ((p.y - low[1]) / HEIGHT_CELL_M).round() as usize;
            let k = row.min(rows - 1) * columns + column.min(columns - 1);
            sums[k] += above(p) as f32;
            weights[k] += 1.0;
            square += above(p).powi(2);
        }

        let noise_m = (square / points.len() as f64).sqrt();
        let occupied = weights.iter().filter(|w| **w > 0.0_f32).count() as f64;
        let spacing_m = HEIGHT_CELL_M * (occupied / points.len() as f64).sqrt();
        // A Gaussian window of this reach averages 4 pi reach^2 / spacing^2 points.
        let reach_m = noise_m * spacing_m / (HEIGHT_NOISE_M * (4.0 * std::f64::consts::PI).sqrt());
        let reach = reach_m.clamp(SMOOTHING_M[0], SMOOTHING_M[1]) / HEIGHT_CELL_M;
        let smooth = |v: &[f32]| blur(v, columns, rows, reach);
        let heights = smooth(&sums)
            .iter()
            .zip(smooth(&weights))
            .map(|(s, w)| if w > 1e-9 { s / w } else { 0.0 })
            .collect();

        Some(Self {
            plane,
            low,
            columns,
            rows,
            heights,
        })
    }

    fn at(&self, u: f64, v: f64) -> f64 {
        let cell = |x: f64, low: f64, count: usize| {
            ((x - low) / HEIGHT_CELL_M).clamp(0.0, (count - 1) as f64 - 1e-6)
        };
        let (x, y) = (
            cell(u, self.low[0], self.columns),
            cell(v, self.low[1], self.rows),
        );
        let (c, r) = (x as usize, y as usize);
        let (s, t) = (x - c as f64, y - r as f64);
        let h = |dc: usize, dr: usize| f64::from(self.heights[(r + dr) * self.columns + c + dc]);
        let above = (1.0 - t) * ((1.0 - s) * h(0, 0) + s * h(1, 0)) + t * ((1.0 - s) * h(0, 1) + s * h(1, 1));
        self.plane.x + self.plane.y * u + self.plane.z * v + above
    }
}

/// z = a + b x + c y by least squares, twice: points beyond three root mean squares of the first fit do not
/// count in the second.
fn fit_plane(points: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    if points.len() < LEAST_POINTS {
        return None;
    }
    let fit = |limit: f64, plane: Vector3<f64>| {
        let (mut n, mut b, mut square, mut count) = (Matrix3::zeros(), Vector3::zeros(), 0.0, 0.0);
        for p in points {
            let row = Vector3::new(1.0, p.x, p.y);
            let residual = p.z - row.dot(&plane);
            if residual.abs() <= limit {
                n += row * row.transpose();
                b += row * p.z;
                square += residual * residual;
                count += 1.0;
            }
        }
        Some((n.cholesky()?.solve(&b), square / f64::max(count, 1.0)))
    };
    let (rough, _) = fit(f64::INFINITY, Vector3::zeros())?;
    let (_, square) = fit(f64::INFINITY, rough)?;
    fit(3.0 * square.sqrt(), rough).map(|(plane, _)| plane)
}
