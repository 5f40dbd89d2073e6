//! The dam frame at a point of the visible face.

use nalgebra::{Matrix3, Unit, Vector3};

/// Along-dam, up and out-of-plane axes at a point of the face, unit vectors in the world frame.
///
/// `out` is the outward normal of the face (downstream); `along` is horizontal, to the right of a viewer who
/// faces the wall; `up` lies in the face, along the batter. Right-handed: `along` x `up` = `out`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceFrame {
    /// Horizontal direction in the face.
    pub along: Vector3<f64>,
    /// Steepest upward direction in the face.
    pub up: Vector3<f64>,
    /// Outward normal of the face.
    pub out: Vector3<f64>,
}

impl FaceFrame {
    /// The frame of a face with this outward normal (any length but zero); world z points up.
    ///
    /// On a level face, where along and up are not defined, along is world x.
    pub fn from_normal(outward: &Vector3<f64>) -> Self {
        let out = Unit::try_new(*outward, f64::MIN_POSITIVE).map_or(Vector3::x(), Unit::into_inner);
        let horizontal = Vector3::z().cross(&out);
        let along = if horizontal.norm() > 1e-9 {
            horizontal.normalize()
        } else {
            Vector3::x()
        };
        let along = (along - out * out.dot(&along)).normalize();
        Self {
            along,
            up: out.cross(&along),
            out,
        }
    }

    /// Rotation that takes world components to (along, up, out).
    pub fn face_from_world(&self) -> Matrix3<f64> {
        Matrix3::from_rows(&[self.along.transpose(), self.up.transpose(), self.out.transpose()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_battered_face_that_looks_along_x_has_along_y() {
        let frame = FaceFrame::from_normal(&Vector3::new(1.0, 0.0, 0.2));
        assert!((frame.along - Vector3::y()).norm() < 1e-12);
        assert!(frame.up.z > 0.9 && frame.up.x < 0.0);
        let r = frame.face_from_world();
        assert!((r * r.transpose() - Matrix3::identity()).norm() < 1e-12);
        assert!((r.determinant() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_level_face_still_has_an_orthonormal_frame() {
        let r = FaceFrame::from_normal(&Vector3::z()).face_from_world();
        assert!((r.determinant() - 1.0).abs() < 1e-12);
    }
}
