//! A stone's unknowns: its motion in its own frame.

use nalgebra::{Vector3, Vector6};
use std::ops::{Add, Sub};

/// Distance of a stone's rim from its centroid, metres, at which rotation is compared with translation: that of a block of
/// 40 cm.
const RIM_M: f64 = 0.2;
/// Motions no farther apart than this, metres, are alike: what a stone's points say at one of them, such as which
/// points are outliers, also holds at the other.
const ALIKE_M: f64 = 1e-3;

/// Motion of a stone in its frame, whose axes are (along, up, out) of the wall around it.
///
/// The order of the unknowns: translation of the centroid (m), rotation vector (rad).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StoneVector(Vector6<f64>);

impl StoneVector {
    /// No motion.
    pub fn zeros() -> Self {
        Self(Vector6::zeros())
    }

    /// A motion without rotation.
    pub fn from_translation(translation: Vector3<f64>) -> Self {
        Self::from_rigid(translation, Vector3::zeros())
    }

    /// A motion of translation and rotation.
    pub fn from_rigid(translation: Vector3<f64>, rotation: Vector3<f64>) -> Self {
        let mut all = Vector6::zeros();
        all.fixed_rows_mut::<3>(0).copy_from(&translation);
        all.fixed_rows_mut::<3>(3).copy_from(&rotation);
        Self(all)
    }

    /// Translation of the centroid: along, up, out, metres.
    pub fn translation(&self) -> Vector3<f64> {
        self.0.fixed_rows::<3>(0).into_owned()
    }

    /// Rotation vector about (along, up, out), radians.
    pub fn rotation(&self) -> Vector3<f64> {
        self.0.fixed_rows::<3>(3).into_owned()
    }

    /// All six unknowns in order.
    pub fn unknowns(&self) -> &Vector6<f64> {
        &self.0
    }

    /// Distance from another motion, metres: of the centroid, plus that of the rim by rotation.
    pub fn distance_m(&self, other: &Self) -> f64 {
        let d = *self - *other;
        d.translation().norm() + RIM_M * d.rotation().norm()
    }

    /// Whether the two motions are so near that what holds at one also holds at the other ([`ALIKE_M`]).
    pub fn is_alike(&self, other: &Self) -> bool {
        self.distance_m(other) <= ALIKE_M
    }

    /// All six unknowns times `factor`.
    pub fn scaled(&self, factor: f64) -> Self {
        Self(self.0 * factor)
    }
}

impl From<Vector6<f64>> for StoneVector {
    fn from(unknowns: Vector6<f64>) -> Self {
        Self(unknowns)
    }
}

impl Add for StoneVector {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl Sub for StoneVector {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_where_their_names_say() {
        let all = StoneVector::from(Vector6::from_fn(|k, _| k as f64));
        assert_eq!(all.translation(), Vector3::new(0.0, 1.0, 2.0));
        assert_eq!(all.rotation(), Vector3::new(3.0, 4.0, 5.0));
        let moved = all + StoneVector::from_translation(Vector3::new(1.0, 1.0, 1.0)).scaled(-2.0);
        assert_eq!((moved - all).translation(), Vector3::new(-2.0, -2.0, -2.0));
        assert_eq!(moved.rotation(), all.rotation());
    }
}
