//! A photo prepared for the projection of many points.

use crate::geometry::{Camera, View};
use nalgebra::{Matrix3, Point3, Vector3};

/// A view with all quantities that do not depend on the point.
pub(super) struct PhotoFrame<'a> {
    camera: &'a Camera,
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    /// Geometric mean of the focal lengths, pixels. Divided by a depth it gives pixels per metre there.
    pub focal_px: f64,
}

impl<'a> PhotoFrame<'a> {
    pub(super) fn of(view: &'a View) -> Self {
        let [fx, fy] = view.camera.focal_px;
        Self {
            camera: &view.camera,
            rotation: view.cam_from_world.rotation.to_rotation_matrix().into_inner(),
            translation: view.cam_from_world.translation.vector,
            focal_px: (fx * fy).sqrt(),
        }
    }

    /// A world point in the frame of the camera; z is its depth.
    #[inline]
    pub(super) fn point(&self, world: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.rotation * world.coords + self.translation)
    }

    /// A direction of the world in the frame of the camera.
    pub(super) fn direction(&self, world: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * world
    }

    /// Pixel of a point in the frame of the camera; `None` where the photo does not show it.
    #[inline]
    pub(super) fn pixel(&self, point: &Point3<f64>) -> Option<[f64; 2]> {
        let pixel = self.camera.project_camera_point(point)?;
        self.camera.is_inside(pixel).then_some(pixel)
    }
}
