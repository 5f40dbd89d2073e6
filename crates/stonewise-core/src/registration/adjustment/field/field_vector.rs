//! The field's unknowns at a stone.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// The nine unknowns of the field at a stone, without names.
pub(crate) type Vector9 = SVector<f64, 9>;
/// A matrix over them.
pub(crate) type Matrix9 = SMatrix<f64, 9, 9>;
/// Takes them to the six unknowns of a stone.
pub(crate) type StoneFromField = SMatrix<f64, 6, 9>;

/// The field of motion at a stone, world axes: displacement, and its derivatives along the face.
///
/// The order of the unknowns: displacement (m), gradient along the face, gradient up the face (metre per
/// metre).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FieldVector(Vector9);

impl FieldVector {
    /// Displacement of the stone's centroid, metres.
    pub fn displacement(&self) -> Vector3<f64> {
        self.0.fixed_rows::<3>(0).into_owned()
    }

    /// Change of the displacement per metre along the face.
    pub fn gradient_along(&self) -> Vector3<f64> {
        self.0.fixed_rows::<3>(3).into_owned()
    }

    /// Change of the displacement per metre up the face.
    pub fn gradient_up(&self) -> Vector3<f64> {
        self.0.fixed_rows::<3>(6).into_owned()
    }

    /// All nine unknowns in order.
    pub fn unknowns(&self) -> &Vector9 {
        &self.0
    }
}

impl From<Vector9> for FieldVector {
    fn from(unknowns: Vector9) -> Self {
        Self(unknowns)
    }
}

/// Takes field unknowns to the motion, in its frame, of a stone that moves with the field.
///
/// Rotation about along and up is the tilt of the face, rotation about out half the curl of the motion in it
/// (small angles). `frame` takes world axes to (along, up, out).
pub(crate) fn stone_from_field(frame: &Matrix3<f64>) -> StoneFromField {
    let mut a = StoneFromField::zeros();
    a.fixed_view_mut::<3, 3>(0, 0).copy_from(frame);
    for c in 0..3 {
        a[(3, 6 + c)] = frame[(2, c)];
        a[(4, 3 + c)] = -frame[(2, c)];
        a[(5, 3 + c)] = 0.5 * frame[(1, c)];
        a[(5, 6 + c)] = -0.5 * frame[(0, c)];
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::FaceFrame;
    use crate::registration::adjustment::stone_vector::StoneVector;

    #[test]
    fn a_field_that_turns_the_wall_turns_its_stones() {
        let frame = FaceFrame::from_normal(&Vector3::new(0.8, 0.5, 0.1).normalize()).face_from_world();
        let turn = Vector3::new(2e-3, -3e-3, 5e-3);
        let shift = Vector3::new(0.01, 0.02, -0.03);
        let [along, up] = [0, 1].map(|k| frame.row(k).transpose());
        let mut field = Vector9::zeros();
        field.fixed_rows_mut::<3>(0).copy_from(&shift);
        field.fixed_rows_mut::<3>(3).copy_from(&turn.cross(&along));
        field.fixed_rows_mut::<3>(6).copy_from(&turn.cross(&up));
        let stone = StoneVector::from(stone_from_field(&frame) * field);
        assert!((stone.translation() - frame * shift).norm() < 1e-15);
        assert!((stone.rotation() - frame * turn).norm() < 1e-15);
    }
}
