//! Rotations from matrices.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

/// Largest difference of a quaternion's length from 1 that is taken for rounding.
const MOST_UNLIKE_ONE: f64 = 0.1;

/// The rotation of a quaternion read from text or from a file; `None` where its length is not 1 but for rounding.
pub fn rotation_of(quaternion: Quaternion<f64>) -> Option<UnitQuaternion<f64>> {
    let is_unit = (quaternion.norm() - 1.0).abs() < MOST_UNLIKE_ONE;
    is_unit.then(|| UnitQuaternion::from_quaternion(quaternion))
}

/// The rotation nearest to a matrix in the sense of least squares (Kabsch 1976), for matrices read from text.
pub fn nearest_rotation(matrix: &Matrix3<f64>) -> UnitQuaternion<f64> {
    let svd = matrix.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return UnitQuaternion::identity();
    };
    let sign = (u * v_t).determinant().signum();
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation))
}
