//! A camera with its place in the world.

use crate::geometry::{Camera, Rigid3};
use crate::id::ImageId;
use nalgebra::Point3;

/// A posed photo.
#[derive(Clone, Debug)]
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

impl View {
    /// Centre of projection in the world frame.
    pub fn centre(&self) -> Point3<f64> {
        self.cam_from_world.inverse_transform_point(&Point3::origin())
    }
}
