//! A square of the wall's face as a raster: its relief, or which of its points belong to stones.

use crate::geometry::FaceFrame;
use crate::raster::SumTable;
use crate::statistics::upper_median;
use nalgebra::{Point3, Vector3};

/// Edge of a cell, metres: joints of 1 cm still show as a dip of a few millimetres, and clouds of a point
/// every 15 mm fill the raster.
pub(super) const CELL_M: f64 = 0.02;
/// Half width of the window whose mean is taken off, cells: the shape of the wall has no part in the
/// comparison.
const WINDOW: usize = 12;
/// Deviations beyond this many times the median one count as much as that: a plant or a railing is no relief.
const LIMIT: f32 = 4.0;

/// A square of the face that is being filled with points.
#[derive(Clone, Debug)]
pub struct FaceGrid {
    centre: Point3<f64>,
    frame: FaceFrame,
    half: i64,
    /// Per cell, row by row from the lower left: sum of the values and number of points.
    sums: Vec<(f64, u32)>,
}

impl FaceGrid {
    /// A square about `centre` on a face with this outward normal, `half_m` to every side.
    pub fn new(centre: Point3<f64>, normal: &Vector3<f64>, half_m: f64) -> Self {
        let half = (half_m / CELL_M).round() as i64;
        Self {
            centre,
            frame: FaceFrame::from_normal(normal),
            half,
            sums: vec![(0.0, 0); (2 * half + 1).pow(2) as usize],
        }
    }

    /// Height of a point above the plane through the centre, metres.
    pub fn height(&self, p: &Point3<f64>) -> f64 {
        (p - self.centre).dot(&self.frame.out)
    }

    /// Adds a point's value to its cell; points beyond the square are left out.
    pub fn add(&mut self, p: &Point3<f64>, value: f64) {
        let q = p - self.centre;
        let cell = |axis: &Vector3<f64>| (q.dot(axis) / CELL_M).round() as i64 + self.half;
        let (i, j) = (cell(&self.frame.along), cell(&self.frame.up));
        let inside = 0..=2 * self.half;
        if inside.contains(&i) && inside.contains(&j) {
            let sum = &mut self.sums[(j * (2 * self.half + 1) + i) as usize];
            sum.0 += value;
            sum.1 += 1;
        }
    }

    /// The means of the cells, compared with their surroundings.
    pub fn finish(&self) -> FacePatch {
        let mean = |(sum, n): &(f64, u32)| match n {
            0 => f32::NAN,
            n => (sum / f64::from(*n)) as f32,
        };
        let mut patch = FacePatch {
            side: (2 * self.half + 1) as usize,
            values: self.sums.iter().map(mean).collect(),
        };
        patch.take_off_surroundings();
        patch.scale();
        patch
    }
}

/// A raster of `side` x `side` cells, row by row from the lower left, along and up the face; NaN where no
/// point lies.
///
/// Values are deviations from their surroundings, divided by their median absolute deviation.
#[derive(Clone, Debug)]
pub struct FacePatch {
    pub(super) side: usize,
    pub(super) values: Vec<f32>,
}

impl FacePatch {
    /// Takes the mean of the surroundings off every value.
    fn take_off_surroundings(&mut self) {
        let side = self.side;
        // Sums of values and counts.
        let table = SumTable::new([side, side], |i, j| {
            let v = self.values[j * side + i];
            v.is_finite().then_some([f64::from(v), 1.0])
        });
        for j in 0..side {
            for i in 0..side {
                let [sum, n] = table.window([i, j], WINDOW);
                // NaN stays where no point lies.
                self.values[j * side + i] -= (sum / n.max(1.0)) as f32;
            }
        }
    }

    /// Divides by the usual deviation, and limits what exceeds it.
    fn scale(&mut self) {
        let mut known: Vec<f64> = self
            .values
            .iter()
            .filter(|v| v.is_finite())
            .map(|v| f64::from(v.abs()))
            .collect();
        let usual = upper_median(&mut known).unwrap_or(1.0).max(1e-9) as f32;
        for v in &mut self.values {
            *v = (*v / usual).clamp(-LIMIT, LIMIT);
        }
    }
}
