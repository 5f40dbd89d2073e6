//! Photos for tracking: cameras, and the parts of photos that show a stone.

use crate::geometry::View;
use nalgebra::{Matrix2, Matrix3, Point3, RowVector2, Vector3};

/// Where a photo shows a point of the world.
///
/// A trait, so that a self-check can pass a camera that projects moved points to their former pixels.
pub trait PhotoCamera: Send + Sync {
    /// Pixel of a world point, which may lie outside the image; `None` behind the camera.
    fn project(&self, world: &Point3<f64>) -> Option<[f64; 2]>;
    /// Centre of projection, world.
    fn centre(&self) -> Point3<f64>;
    /// Height of the photo, pixels.
    fn height_px(&self) -> f64;
}

impl PhotoCamera for View {
    fn project(&self, world: &Point3<f64>) -> Option<[f64; 2]> {
        View::project(self, world).map(|p| p.pixel)
    }

    fn centre(&self) -> Point3<f64> {
        View::centre(self)
    }

    fn height_px(&self) -> f64 {
        f64::from(self.camera.height)
    }
}

/// A posed photo.
pub struct Photo {
    /// Its name, for reports.
    pub name: String,
    /// 0: of the first epoch, 1: of the second.
    pub epoch: usize,
    /// Its camera.
    pub camera: Box<dyn PhotoCamera>,
}

/// How a point of a face seems to move when a photo's rows are shifted in proportion to their distance from
/// the middle row, per pixel of shift of the last row relative to the first: along the rows, along the
/// columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ByRows {
    /// Shift in the face, metres, one column for each direction.
    pub shift: Matrix2<f64>,
    /// Turn in the face from the axis along to the axis up, radians.
    pub turn: RowVector2<f64>,
}

#[cfg(test)]
impl ByRows {
    /// No effect.
    pub fn none() -> Self {
        Self {
            shift: Matrix2::zeros(),
            turn: RowVector2::zeros(),
        }
    }
}

/// Distance over which a camera's scale is measured, metres: far below a pixel on the wall, far above
/// rounding.
const STEP_M: f64 = 1e-4;

impl Photo {
    /// Size of a pixel on a face at this point, metres: square root of its area there. `None` where the photo
    /// does not see the point.
    pub fn pixel_m(&self, at: &Point3<f64>, along: &Vector3<f64>, up: &Vector3<f64>) -> Option<f64> {
        let (_, scale) = self.pixels_per_metre(at, along, up)?;
        let area = scale.determinant().abs();
        (area > 0.0).then(|| area.sqrt().recip())
    }

    /// Pixel of this point, and its derivatives along and up a face, pixels per metre.
    fn pixels_per_metre(
        &self,
        at: &Point3<f64>,
        along: &Vector3<f64>,
        up: &Vector3<f64>,
    ) -> Option<([f64; 2], Matrix2<f64>)> {
        let here = self.camera.project(at)?;
        let step = |axis: &Vector3<f64>| {
            let there = self.camera.project(&(at + axis * STEP_M))?;
            Some([(there[0] - here[0]) / STEP_M, (there[1] - here[1]) / STEP_M])
        };
        let (a, b) = (step(along)?, step(up)?);
        Some((here, Matrix2::new(a[0], b[0], a[1], b[1])))
    }

    /// Effect of a shift of the photo's rows at this point of a face; `None` where the photo does not see it.
    pub(crate) fn by_rows(&self, at: &Point3<f64>, face_from_world: &Matrix3<f64>) -> Option<ByRows> {
        let axis = |r: usize| face_from_world.row(r).transpose();
        let (pixel, scale) = self.pixels_per_metre(at, &axis(0), &axis(1))?;
        let (inverse, height_px) = (scale.try_inverse()?, self.camera.height_px());
        Some(ByRows {
            shift: inverse * (pixel[1] / height_px - 0.5),
            turn: (inverse.row(1) * scale[(1, 0)] - inverse.row(0) * scale[(1, 1)]) * (0.5 / height_px),
        })
    }

    /// Shift in the face of what stands a metre out of it, in a frame (along, up, out): the photo's parallax
    /// at this point.
    pub(crate) fn parallax(&self, at: &Point3<f64>, face_from_world: &Matrix3<f64>) -> Option<[f64; 2]> {
        let ray = face_from_world * (at - self.camera.centre());
        (ray.z < 0.0).then(|| [-ray.x / ray.z, -ray.y / ray.z])
    }
}

/// The part of a photo that shows a stone, grey values.
#[derive(Clone, Debug, PartialEq)]
pub struct Chip {
    /// Which of the photos.
    pub photo: u32,
    /// Pixel of its corner in the photo.
    pub corner: [u32; 2],
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Grey values, row by row.
    pub grey: Vec<u8>,
}

impl Chip {
    /// Grey value at a pixel coordinate of the photo, by cubic convolution (Keys 1981); `None` within two
    /// pixels of the chip's edge.
    pub(crate) fn sample(&self, pixel: [f64; 2]) -> Option<f32> {
        let x = pixel[0] - f64::from(self.corner[0]) - 0.5;
        let y = pixel[1] - f64::from(self.corner[1]) - 0.5;
        let inside = |v: f64, size: u32| v >= 1.0 && v < f64::from(size) - 2.0;
        if !(inside(x, self.width) && inside(y, self.height)) {
            return None;
        }
        // Conversion to 32 bits takes fewer instructions.
        let (column, row) = (x as u32 as usize, y as u32 as usize);
        let (wx, wy) = (cubic((x - column as f64) as f32), cubic((y - row as f64) as f32));
        let mut lines = [[0.0; 4]; 4];
        for (j, line) in lines.iter_mut().enumerate() {
            let start = (row + j - 1) * self.width as usize + column - 1;
            let grey: &[u8; 4] = self.grey.get(start..)?.first_chunk()?;
            for (to, from) in line.iter_mut().zip(grey) {
                *to = f32::from(*from);
            }
        }
        Some(weighted(&lines, wx, wy))
    }
}

/// Weights of four neighbours for a place `t` between the second and the third (Keys 1981, a = -1/2).
#[inline]
pub(super) fn cubic(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        -0.5 * t3 + t2 - 0.5 * t,
        1.5 * t3 - 2.5 * t2 + 1.0,
        -1.5 * t3 + 2.0 * t2 + 0.5 * t,
        0.5 * t3 - 0.5 * t2,
    ]
}

/// Sum of four lines of four values with weights along the lines and across them.
#[inline]
pub(super) fn weighted(lines: &[[f32; 4]; 4], along: [f32; 4], across: [f32; 4]) -> f32 {
    let mut sums = [0.0; 4];
    for (line, weight) in lines.iter().zip(across) {
        for (sum, value) in sums.iter_mut().zip(line) {
            *sum += weight * value;
        }
    }
    sums.iter().zip(along).map(|(s, w)| s * w).sum()
}

#[cfg(test)]
mod tests {
    use super::super::testing::oblique;
    use super::*;

    #[test]
    fn cubic_convolution_reproduces_parabolas() {
        let value = |x: f64, y: f64| 3.0 + 0.5 * x + 0.25 * y + 0.125 * x * x;
        let chip = Chip {
            photo: 0,
            corner: [100, 40],
            width: 20,
            height: 10,
            grey: (0..200)
                .map(|k| (value(f64::from(k % 20), f64::from(k / 20)) * 4.0).round() as u8)
                .collect(),
        };
        // Middles of pixels lie at halves.
        let at = chip.sample([100.0 + 7.5, 40.0 + 4.5]).unwrap();
        assert!((f64::from(at) / 4.0 - value(7.0, 4.0)).abs() < 0.13);
        let at = chip.sample([100.0 + 7.9, 40.0 + 4.75]).unwrap();
        assert!((f64::from(at) / 4.0 - value(7.4, 4.25)).abs() < 0.13);
        assert_eq!(chip.sample([100.2, 44.0]), None);
        assert_eq!(chip.sample([119.5, 44.0]), None);
    }

    #[test]
    fn rows_shift_what_they_show_in_proportion_to_their_distance_from_the_middle() {
        let (photo, at, turn) = oblique();
        let pixel = photo.camera.project(&at).unwrap();
        let share = (pixel[1] - 750.0) / 1500.0;
        assert!(share.abs() > 0.1, "{share}");
        let by_rows = photo.by_rows(&at, &turn).unwrap().shift;
        for shift_px in [[2.0, 0.0], [0.0, 2.0]] {
            let moved = by_rows * nalgebra::Vector2::from(shift_px);
            let seen = photo
                .camera
                .project(&(at + turn.transpose() * Vector3::new(moved.x, moved.y, 0.0)));
            let seen = seen.unwrap();
            for k in 0..2 {
                let expected = pixel[k] + share * shift_px[k];
                assert!((seen[k] - expected).abs() < 1e-3, "{seen:?} {expected}");
            }
        }
    }

    #[test]
    fn parallax_is_how_a_raised_point_seems_to_shift() {
        let (photo, at, turn) = oblique();
        let (normal, centre) = (turn.row(2).transpose(), photo.camera.centre());
        let q = photo.parallax(&at, &turn).unwrap();
        let raised = photo.camera.project(&(at + normal * 1e-4)).unwrap();
        let shifted = at + turn.transpose() * Vector3::new(q[0], q[1], 0.0) * 1e-4;
        let seen = photo.camera.project(&shifted).unwrap();
        assert!(
            (raised[0] - seen[0]).abs() + (raised[1] - seen[1]).abs() < 1e-5,
            "{raised:?} {seen:?}"
        );
        let axis = |r: usize| turn.row(r).transpose();
        let pixel_m = photo.pixel_m(&at, &axis(0), &axis(1)).unwrap();
        // A pixel on a surface across the ray is distance / focal length; the face is oblique and takes more.
        let across = (at - centre).norm() / 1800.0;
        assert!(pixel_m > across && pixel_m < 1.2 * across, "{pixel_m} {across}");
    }
}
