//! Poses as matrices.

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion};
use stonewise_core::geometry::Rigid3;

/// From the axes of a camera as OpenGL has them (y up, z against the view) to those of this crate, and back.
pub const FLIP: Matrix3<f64> = Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0);

/// The rotation that a matrix represents; `None` where it is not a rotation to a thousandth.
pub fn rotation(turn: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let error = (turn.transpose() * turn - Matrix3::identity()).amax();
    let is_rotation = error <= 1e-3 && turn.determinant() > 0.0;
    is_rotation.then(|| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(turn)))
}

/// World to camera, of a camera at this place with this rotation from world to camera.
pub fn camera_at(centre: Point3<f64>, cam_from_world: &UnitQuaternion<f64>) -> Rigid3 {
    Rigid3::from_parts(centre.into(), cam_from_world.inverse()).inverse()
}
