//! A camera with its place in the world.

use crate::geometry::{Camera, Rigid3};
use crate::id::ImageId;
use nalgebra::{Point3, Vector3};

/// A posed photo.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Which photo of the epoch.
    pub image: ImageId,
    /// File name of the photo, as the camera file gives it (extension may be missing).
    pub name: String,
    /// Interior orientation.
    pub camera: Camera,
    /// Exterior orientation.
    pub cam_from_world: Rigid3,
}

/// Where a photo shows a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// Pixel coordinates, which may lie outside the image.
    pub pixel: [f64; 2],
    /// Distance along the view axis, metres.
    pub depth_m: f64,
}

impl View {
    /// Centre of projection in the world frame.
    pub fn centre(&self) -> Point3<f64> {
        self.cam_from_world.inverse_transform_point(&Point3::origin())
    }

    /// Where the photo would show a world point if nothing stood in front of it.
    ///
    /// `None` behind the camera and outside the range of the lens model; the pixel may still lie outside the
    /// image, see [`View::is_inside`].
    #[inline]
    pub fn project(&self, world: &Point3<f64>) -> Option<Projection> {
        let point = self.cam_from_world * world;
        let pixel = self.camera.project_camera_point(&point)?;
        Some(Projection {
            pixel,
            depth_m: point.z,
        })
    }

    /// Whether a pixel coordinate lies in the image.
    #[inline]
    pub fn is_inside(&self, pixel: [f64; 2]) -> bool {
        self.camera.is_inside(pixel)
    }

    /// Ray through a pixel in the world frame: centre of projection and unit direction.
    pub fn ray(&self, pixel: [f64; 2]) -> Option<(Point3<f64>, Vector3<f64>)> {
        let direction = self.camera.unproject(pixel)?;
        let world = self.cam_from_world.inverse_transform_vector(&direction);
        Some((self.centre(), world.normalize()))
    }

    /// Ground sampling distance on a surface that faces the camera at this depth, metres per pixel.
    #[inline]
    pub fn gsd_m(&self, depth_m: f64) -> f64 {
        let [fx, fy] = self.camera.focal_px;
        depth_m / (fx * fy).sqrt()
    }
}
