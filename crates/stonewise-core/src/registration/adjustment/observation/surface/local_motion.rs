//! A stone's motion undone: the second epoch's points in the place of the first.

use crate::registration::adjustment::stone_vector::StoneVector;
use nalgebra::{Rotation3, Vector3};

/// Takes points of the second epoch back to where they were in the first.
pub(crate) struct InverseMotion {
    translation: Vector3<f64>,
    rotation: Rotation3<f64>,
    bending: [f64; 3],
}

impl InverseMotion {
    pub fn new(motion: &StoneVector) -> Self {
        Self {
            translation: motion.translation(),
            rotation: Rotation3::new(motion.rotation()),
            bending: motion.bending().into(),
        }
    }

    /// By how much it moves a point of the second epoch at the stone's centroid along the face.
    pub fn shift_in_face(&self) -> [f64; 2] {
        [-self.translation.x, -self.translation.y]
    }

    /// Where a point of the second epoch was in the first; bending is taken off its height.
    pub fn undo(&self, q: &[f64; 3]) -> [f64; 3] {
        let y = self
            .rotation
            .inverse_transform_vector(&(Vector3::from(*q) - self.translation));
        let [uu, uv, vv] = self.bending;
        [
            y.x,
            y.y,
            y.z - 0.5 * (uu * y.x * y.x + 2.0 * uv * y.x * y.y + vv * y.y * y.y),
        ]
    }

    /// Derivative of the residual of a point, now at `p`, with respect to the motion, where the surface has
    /// these slopes.
    pub fn jacobian(&self, p: &[f64; 3], slopes: [f64; 2]) -> [f64; 9] {
        let [u, v, _] = *p;
        let [uu, uv, vv] = self.bending;
        let m = self.rotation
            * Vector3::new(
                -(slopes[0] + uu * u + uv * v),
                -(slopes[1] + uv * u + vv * v),
                1.0,
            );
        let arm = self.rotation * Vector3::new(u, v, p[2]);
        let r = m.cross(&arm);
        [
            -m.x,
            -m.y,
            -m.z,
            r.x,
            r.y,
            r.z,
            -u * u / 2.0,
            -u * v,
            -v * v / 2.0,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::stone_vector::Vector9;

    #[test]
    fn the_jacobian_is_the_derivative_of_the_residual() {
        // A sloping plane, z = 0.3 u - 0.2 v: the residual is the height above it, its slopes are the same
        // everywhere.
        let slopes = [0.3, -0.2];
        let at = Vector9::from_column_slice(&[0.01, -0.02, 0.03, 0.04, -0.05, 0.06, 0.2, -0.1, 0.3]);
        let point = [0.11, -0.07, 0.05];
        let residual = |unknowns: &Vector9| {
            let [u, v, z] = InverseMotion::new(&StoneVector::from(*unknowns)).undo(&point);
            z - slopes[0] * u - slopes[1] * v
        };
        let inverse = InverseMotion::new(&StoneVector::from(at));
        let row = inverse.jacobian(&inverse.undo(&point), slopes);
        for k in 0..9 {
            let step = 1e-6;
            let moved = |by: f64| {
                let mut unknowns = at;
                unknowns[k] += by * step;
                residual(&unknowns)
            };
            let slope = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            // Rotation vectors add up to second order in the rotation only.
            let allowed = if (3..6).contains(&k) { 0.01 } else { 1e-3 };
            assert!((slope - row[k]).abs() < allowed, "{k}: {slope} {}", row[k]);
        }
    }
}
