//! A stone's motion, which takes points of one epoch to the place of the other.

use crate::registration::adjustment::stone_vector::StoneVector;
use nalgebra::{Rotation3, Vector3};

/// Takes points of the first epoch to where they are in the second, and back.
pub(crate) struct LocalMotion {
    translation: Vector3<f64>,
    rotation: Rotation3<f64>,
}

/// The epoch whose points stay where they are, while those of the other are moved onto its surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Still {
    First,
    Second,
}

impl LocalMotion {
    pub fn new(motion: &StoneVector) -> Self {
        Self {
            translation: motion.translation(),
            rotation: Rotation3::new(motion.rotation()),
        }
    }

    /// Where a point of the first epoch is in the second.
    pub fn apply(&self, p: &[f64; 3]) -> [f64; 3] {
        (self.rotation * Vector3::from(*p) + self.translation).into()
    }

    /// Where a point of the second epoch was in the first.
    pub fn undo(&self, q: &[f64; 3]) -> [f64; 3] {
        self.rotation
            .inverse_transform_vector(&(Vector3::from(*q) - self.translation))
            .into()
    }

    /// Derivative, with respect to the motion, of the residual of a point of the second epoch moved back, or of the
    /// negative residual of one of the first epoch moved onto the second. The point is now at `p`, where the surface
    /// has these slopes.
    #[inline(always)]
    pub fn jacobian(&self, still: Still, p: &[f64; 3], slopes: [f64; 2]) -> [f64; 6] {
        let upright = Vector3::new(-slopes[0], -slopes[1], 1.0);
        // Normal of the surface and arm of the point, turned as in the second epoch.
        let (m, arm) = match still {
            Still::First => (self.rotation * upright, self.rotation * Vector3::from(*p)),
            Still::Second => (upright, Vector3::from(*p) - self.translation),
        };
        let r = m.cross(&arm);
        [-m.x, -m.y, -m.z, r.x, r.y, r.z]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;

    const AT: [f64; 6] = [0.01, -0.02, 0.03, 0.04, -0.05, 0.06];
    const POINT: [f64; 3] = [0.11, -0.07, 0.05];

    fn motion(unknowns: &Vector6<f64>) -> LocalMotion {
        LocalMotion::new(&StoneVector::from(*unknowns))
    }

    #[test]
    fn undoing_a_motion_brings_a_point_back() {
        let motion = motion(&Vector6::from(AT));
        let back = motion.undo(&motion.apply(&POINT));
        let apart = Vector3::from(back) - Vector3::from(POINT);
        assert!(apart.norm() < 1e-15, "{apart}");
    }

    #[test]
    fn the_jacobian_is_the_derivative_of_the_residual() {
        // A sloping plane, z = 0.3 u - 0.2 v: the residual is the height above it, its slopes are the same
        // everywhere.
        let slopes = [0.3, -0.2];
        let above = |[u, v, z]: [f64; 3]| z - slopes[0] * u - slopes[1] * v;
        let at = Vector6::from(AT);
        for still in [Still::First, Still::Second] {
            let residual = |unknowns: &Vector6<f64>| match still {
                Still::First => above(motion(unknowns).undo(&POINT)),
                Still::Second => -above(motion(unknowns).apply(&POINT)),
            };
            let now = match still {
                Still::First => motion(&at).undo(&POINT),
                Still::Second => motion(&at).apply(&POINT),
            };
            let row = motion(&at).jacobian(still, &now, slopes);
            for k in 0..6 {
                let step = 1e-6;
                let moved = |by: f64| {
                    let mut unknowns = at;
                    unknowns[k] += by * step;
                    residual(&unknowns)
                };
                let slope = (moved(1.0) - moved(-1.0)) / (2.0 * step);
                // Rotation vectors add up to second order in the rotation only.
                let allowed = if (3..6).contains(&k) { 0.01 } else { 1e-3 };
                assert!(
                    (slope - row[k]).abs() < allowed,
                    "{still:?} {k}: {slope} {}",
                    row[k]
                );
            }
        }
    }
}
