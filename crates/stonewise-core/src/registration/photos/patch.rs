//! Photos brought onto a stone's face, and their contrast normalised.

use super::blur::blur;
use super::photo::{Chip, Photo, cubic};
use super::surface::Surface;
use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};

/// Noise of grey values that is not raised to full contrast, 0..255: a smooth face stays smooth.
const GREY_NOISE: f64 = 3.0;
/// Smoothing before contrast is normalised, cells: interpolation errors of single pixels go.
const PIXEL_BLUR: f64 = 0.7;

/// A rigid motion of a stone, in its frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FaceMotion {
    pub translation: Vector3<f64>,
    pub rotation: Vector3<f64>,
}

impl FaceMotion {
    /// No motion.
    pub fn none() -> Self {
        Self {
            translation: Vector3::zeros(),
            rotation: Vector3::zeros(),
        }
    }

    /// Displacement of a place on the face, small angles, metres.
    pub fn at(&self, place: [f64; 2]) -> Vector3<f64> {
        self.translation + self.rotation.cross(&Vector3::new(place[0], place[1], 0.0))
    }
}

/// Values on the grid of a stone's face.
pub(crate) struct Patch {
    pub values: Vec<f32>,
    /// Whether the photo shows the cell.
    pub valid: Vec<bool>,
}

/// Where a stone's face lies.
pub(crate) struct Placed<'a> {
    pub surface: &'a Surface,
    pub centroid: Point3<f64>,
    pub face_from_world: &'a Matrix3<f64>,
}

impl Placed<'_> {
    /// World point of a cell after a motion.
    fn world(&self, k: usize, motion: &FaceMotion, turn: &UnitQuaternion<f64>) -> Point3<f64> {
        let [u, v] = self.surface.place(k);
        let at = turn * Vector3::new(u, v, self.surface.heights[k]) + motion.translation;
        self.centroid + self.face_from_world.transpose() * at
    }

    /// Grey values of a photo on the moved face; `None` where the photo does not show it.
    pub fn grey(&self, photo: &Photo, chip: &Chip, motion: &FaceMotion) -> Vec<Option<f32>> {
        let turn = UnitQuaternion::from_scaled_axis(motion.rotation);
        (0..self.surface.heights.len())
            .map(|k| {
                let pixel = photo.camera.project(&self.world(k, motion, &turn))?;
                chip.sample(pixel)
            })
            .collect()
    }
}

/// Differences from the local mean over the local standard deviation, in a Gaussian window of this standard
/// deviation.
pub(super) fn normalised(grey: &[Option<f32>], surface: &Surface, window_m: f64) -> Patch {
    let (columns, rows) = (surface.columns, surface.rows);
    let valid: Vec<bool> = grey.iter().map(Option::is_some).collect();
    let weight: Vec<f64> = valid.iter().map(|v| f64::from(u8::from(*v))).collect();
    let window = |values: &[f64], reach: f64| blur(values, columns, rows, reach);
    let over = |values: &[f64], reach: f64, weights: &[f64]| -> Vec<f64> {
        let sums = window(values, reach);
        sums.iter()
            .zip(weights)
            .map(|(s, w)| if *w > 1e-6 { s / w } else { 0.0 })
            .collect()
    };
    let raw: Vec<f64> = grey.iter().map(|g| g.map_or(0.0, f64::from)).collect();
    let zeroed = |values: Vec<f64>| -> Vec<f64> { values.iter().zip(&weight).map(|(v, w)| v * w).collect() };
    let smooth = zeroed(over(&raw, PIXEL_BLUR, &window(&weight, PIXEL_BLUR)));
    let reach = window_m / surface.cell_m;
    let weights = window(&weight, reach);
    let mean = over(&smooth, reach, &weights);
    let apart = zeroed(smooth.iter().zip(&mean).map(|(v, m)| v - m).collect());
    let squares: Vec<f64> = apart.iter().map(|a| a * a).collect();
    let variance = over(&squares, reach, &weights);
    let values = apart
        .iter()
        .zip(variance)
        .map(|(a, v)| (a / (v + GREY_NOISE * GREY_NOISE).sqrt()) as f32)
        .collect();
    Patch { values, valid }
}

impl Patch {
    /// Value at a place in cells, by cubic convolution; `None` outside, and where a cell around it is not
    /// shown.
    pub fn sample(&self, surface: &Surface, x: f64, y: f64) -> Option<f32> {
        let inside = |v: f64, size: usize| v >= 1.0 && v < size as f64 - 2.0;
        if !(inside(x, surface.columns) && inside(y, surface.rows)) {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        let (wx, wy) = (cubic((x - column as f64) as f32), cubic((y - row as f64) as f32));
        let mut sum = 0.0;
        for (j, wy) in wy.iter().enumerate() {
            let start = (row + j - 1) * surface.columns + column - 1;
            if !self.valid[start..start + 4].iter().all(|v| *v) {
                return None;
            }
            let line = &self.values[start..start + 4];
            let of_line: f32 = line.iter().zip(&wx).map(|(g, w)| g * w).sum();
            sum += wy * of_line;
        }
        Some(sum)
    }
}
