//! Camera models: from a point in the camera frame to a pixel and back.
//!
//! Camera frame: x right, y down, z along the view. Pixel frame: x right, y down, first pixel centre (0.5,
//! 0.5).

use super::distortion::Distortion;
use nalgebra::{Point3, Vector3};

/// Interior orientation of a frame or fisheye camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Focal lengths along x and y, pixels.
    pub focal_px: [f64; 2],
    /// Principal point, pixels.
    pub center_px: [f64; 2],
    /// Skew, pixels: how much a distorted unit of y adds to pixel x (Metashape's b2).
    pub skew_px: f64,
    /// Lens distortion, applied to normalised coordinates.
    pub distortion: Distortion,
    /// Before this plane nothing is shown: views of a cloud leave out what stands before the wall. None: all is
    /// shown, as photos do.
    pub near: Option<NearPlane>,
}

/// A plane in the frame of a camera, before which it shows nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearPlane {
    /// Unit normal, away from the camera.
    pub normal: Vector3<f64>,
    /// Distance of the plane from the camera along the normal, metres.
    pub distance_m: f64,
}

impl NearPlane {
    /// Whether a point in the frame of the camera lies before the plane.
    #[inline]
    pub fn hides(&self, point: &Point3<f64>) -> bool {
        self.normal.dot(&point.coords) < self.distance_m
    }
}

impl Camera {
    /// A camera without distortion or skew whose principal point is the middle of the image.
    pub fn pinhole(width: u32, height: u32, focal_px: f64) -> Self {
        Self {
            width,
            height,
            focal_px: [focal_px; 2],
            center_px: [f64::from(width) / 2.0, f64::from(height) / 2.0],
            skew_px: 0.0,
            distortion: Distortion::None,
            near: None,
        }
    }

    /// Pixel of a point in the camera frame, which may lie outside the image.
    ///
    /// `None` behind the camera, before the near plane and where the distortion folds over, that is, where a point
    /// outside the field of view would seem to be inside it.
    #[inline]
    pub fn project_camera_point(&self, point: &Point3<f64>) -> Option<[f64; 2]> {
        if point.z.is_nan() || point.z <= 0.0 {
            return None;
        }
        if self.near.is_some_and(|near| near.hides(point)) {
            return None;
        }
        let place = self.distortion.distort([point.x / point.z, point.y / point.z])?;
        Some(self.pixel_of(place))
    }

    /// Pixel of a place in normalised, distorted coordinates.
    #[inline(always)]
    pub(crate) fn pixel_of(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [
            self.focal_px[0] * x + self.skew_px * y + self.center_px[0],
            self.focal_px[1] * y + self.center_px[1],
        ]
    }

    /// Ray through a pixel in the camera frame, scaled to z = 1; `None` where the lens shows nothing.
    pub fn unproject(&self, pixel: [f64; 2]) -> Option<Vector3<f64>> {
        let yd = (pixel[1] - self.center_px[1]) / self.focal_px[1];
        let xd = (pixel[0] - self.center_px[0] - self.skew_px * yd) / self.focal_px[0];
        let [x, y] = self.distortion.undistort([xd, yd])?;
        Some(Vector3::new(x, y, 1.0))
    }

    /// Whether a pixel coordinate lies in the image.
    #[inline(always)]
    pub fn is_inside(&self, [x, y]: [f64; 2]) -> bool {
        // Without branches, for loops over many points.
        (x >= 0.0) & (y >= 0.0) & (x < f64::from(self.width)) & (y < f64::from(self.height))
    }
}
