//! Panoramas in spherical projection, cut into photos.
//!
//! Frame: as the spherical coordinates of ASTM E2807-11 (libe57.org/bestCoordinates.html): azimuth counterclockwise
//! from +x about +z, elevation from the xy plane up. Azimuth and elevation 0 lie in the middle of the image; azimuth
//! falls by a pixel's width, in radians, with each column to the right, so that the left edge of a full circle is +pi,
//! and elevation by a pixel's height with each row, from +pi/2 at the top of a full sphere.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use stonewise_core::geometry::Camera;
use stonewise_core::raster::{Raster, RgbImage};

/// Azimuths of the photos that a panorama is cut into, degrees, and their cosines and sines.
pub const HEADINGS: [(u32, [f64; 2]); 4] = [
    (0, [1.0, 0.0]),
    (90, [0.0, 1.0]),
    (180, [-1.0, 0.0]),
    (270, [0.0, -1.0]),
];
/// How far the angle of all columns may be from a circle, relative: roundings, and columns counted from 0.
const CLOSED: f64 = 1e-3;

/// The projection of a panorama.
pub struct Panorama {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Width and height of a pixel, radians.
    pub pixel_rad: [f64; 2],
}

impl Panorama {
    /// Whether it shows every azimuth once, and no elevation beyond the zenith.
    pub fn is_full_circle(&self) -> bool {
        let [around, up] = [0, 1].map(|i| f64::from(self.size[i]) * self.pixel_rad[i]);
        (around / TAU - 1.0).abs() < CLOSED && up > 0.0 && up < PI * (1.0 + CLOSED)
    }

    /// The camera of its photos, with a field of view of 90 degrees in both directions.
    pub fn camera(&self) -> Camera {
        let side = self.size[0] / 4;
        Camera::pinhole(side, side, f64::from(side) / 2.0)
    }

    /// The photo that `camera` takes with this rotation from the panorama's frame to its own; black where the panorama
    /// shows nothing.
    pub fn cut(&self, picture: &RgbImage, camera: &Camera, cam_from_local: &UnitQuaternion<f64>) -> RgbImage {
        let mut photo = Raster::filled(camera.width, camera.height, [0; 3]);
        let local_from_cam = cam_from_local.inverse().to_rotation_matrix();
        let rows = photo.data_mut().par_chunks_mut(camera.width as usize);
        rows.enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let ray = camera.unproject([x as f64 + 0.5, y as f64 + 0.5]);
                *pixel = ray.map_or([0; 3], |ray| self.colour(picture, &(local_from_cam * ray)));
            }
        });
        photo
    }

    /// The colour in a direction, interpolated bilinearly.
    fn colour(&self, picture: &RgbImage, direction: &Vector3<f64>) -> [u8; 3] {
        let azimuth = direction.y.atan2(direction.x);
        let elevation = direction.z.atan2(direction.x.hypot(direction.y));
        let [width, height] = self.size.map(f64::from);
        // From the centre of the first pixel.
        let x = width / 2.0 - azimuth / self.pixel_rad[0] - 0.5;
        let y = height / 2.0 - elevation / self.pixel_rad[1] - 0.5;
        if y < -0.5 || y > height - 0.5 {
            return [0; 3];
        }
        let (left, top) = (x.floor(), y.floor());
        let at = |column: f64, row: f64| {
            let column = column.rem_euclid(width) as u32;
            let row = row.clamp(0.0, height - 1.0) as u32;
            picture.get(column, row).map_or([0.0; 3], |p| p.map(f64::from))
        };
        let (right, down) = (x - left, y - top);
        let [a, b] = [at(left, top), at(left + 1.0, top)];
        let [c, d] = [at(left, top + 1.0), at(left + 1.0, top + 1.0)];
        [0, 1, 2].map(|i| {
            let upper = a[i] + (b[i] - a[i]) * right;
            let lower = c[i] + (d[i] - c[i]) * right;
            (upper + (lower - upper) * down).round() as u8
        })
    }
}

/// From the panorama's frame to that of a camera that looks along this azimuth, level.
pub fn cam_from_local([cos, sin]: [f64; 2]) -> UnitQuaternion<f64> {
    // Rows: right, down, ahead.
    let rows = Matrix3::new(sin, -cos, 0.0, 0.0, 0.0, -1.0, cos, sin, 0.0);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows))
}
