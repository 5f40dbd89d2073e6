//! The common registration error of two epochs, from areas that did not move.

use super::gicp::{GicpBlock, GicpParams, GicpStart, GicpStone, align};
use crate::cloud::Cloud;
use crate::geometry::Bounds;
use crate::id::StoneId;
use crate::stone::MotionFailure;
use nalgebra::{Matrix3, Matrix6, Point3, SMatrix, Vector3};
use serde::{Deserialize, Serialize};

/// What stable areas seem to have done between two epochs: the error of the epochs' common registration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DatumError {
    /// Middle of the stable points, world, metres; the shift is that of this place.
    pub centre: Point3<f64>,
    /// Apparent displacement of the centre, second epoch minus first, metres.
    pub shift: Vector3<f64>,
    /// Apparent rotation vector about the centre, radians.
    pub rotation: Vector3<f64>,
    /// Covariance of (shift, rotation), m^2, m rad, rad^2.
    pub covariance: Matrix6<f64>,
    /// Points in the stable areas, per epoch.
    pub points: [usize; 2],
}

/// Most points of an epoch that are used: the error of more is not that of their noise.
const MOST_POINTS: usize = 200_000;

impl DatumError {
    /// Estimates the error from the stable points of both epochs, as one rigid body.
    ///
    /// Plane-to-plane ICP ([`align`]) from no motion; `max_distance_m`, plane and convergence parameters are those of `params`.
    /// Errors: too few points, or a direction in which the areas show no motion.
    pub fn of(first: &Cloud, second: &Cloud, params: &GicpParams) -> Result<Self, MotionFailure> {
        let points = [first.len(), second.len()];
        let thinned = [first, second].map(thin);
        let Some(bounds) = Bounds::of((0..thinned[0].len()).map(|i| thinned[0].world(i))) else {
            return Err(MotionFailure::TooFewPoints {
                first: points[0],
                second: points[1],
                needed: params.min_points,
            });
        };
        let centre = bounds.centre();
        let body = GicpStone {
            first: StoneId(1),
            second: StoneId(1),
            centroid: centre,
            centroid_second: centre,
            points: (0..thinned[0].len() as u32).collect(),
            points_second: thinned[1].len(),
        };
        let params = GicpParams {
            buffer_m: 0.0,
            start: GicpStart::Identity,
            ..params.clone()
        };
        let blocks = thinned.map(|cloud| GicpBlock::new(&cloud, &params));
        let results = align(&blocks[0], &blocks[1], &[body], &params);
        let motion = results
            .into_iter()
            .next()
            .map_or(Err(MotionFailure::NotConverged), |r| r.motion)?;
        Ok(Self {
            centre,
            shift: motion.displacement,
            rotation: motion.rotation,
            covariance: motion.covariance,
            points,
        })
    }

    /// Mean square of the registration error at a place, m^2: what was found there, and the covariance of that.
    pub fn mean_square_at(&self, place: &Point3<f64>) -> Matrix3<f64> {
        let arm = place - self.centre;
        let mut lever = SMatrix::<f64, 3, 6>::zeros();
        lever.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
        lever.fixed_view_mut::<3, 3>(0, 3).copy_from(&-arm.cross_matrix());
        let error = self.shift + self.rotation.cross(&arm);
        lever * self.covariance * lever.transpose() + error * error.transpose()
    }
}

/// Every so many points, so that no more than [`MOST_POINTS`] remain.
fn thin(cloud: &Cloud) -> Cloud {
    let step = cloud.len().div_ceil(MOST_POINTS).max(1);
    let offsets = cloud.offsets().iter().copied().step_by(step).collect();
    Cloud::new(cloud.origin(), offsets)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Ground, a wall and a side wall, 4 m long each, at random places with noise.
    fn corner(seed: u64, noise_m: f64) -> Vec<Point3<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut points = Vec::new();
        for face in 0..3 {
            for _ in 0..8000 {
                let (a, b): (f64, f64) = (rng.random_range(0.0..4.0), rng.random_range(0.0..4.0));
                let off: f64 = (0..12).map(|_| rng.random_range(0.0..1.0)).sum::<f64>() - 6.0;
                let n = noise_m * off;
                points.push(match face {
                    0 => Point3::new(a, b, n),
                    1 => Point3::new(n, a, b),
                    _ => Point3::new(a, n, b),
                });
            }
        }
        points
    }

    #[test]
    fn a_known_registration_error_is_found_within_its_uncertainty() {
        let (turn, shift) = (
            Vector3::new(2e-4, -3e-4, 1e-4),
            Vector3::new(0.004, -0.002, 0.003),
        );
        let origin = Point3::new(2.0, 2.0, 2.0);
        let first = Cloud::from_world(origin, corner(1, 0.002));
        let moved = corner(2, 0.002)
            .into_iter()
            .map(|p| origin + Rotation3::new(turn) * (p - origin) + shift);
        let second = Cloud::from_world(origin, moved);
        let found = DatumError::of(&first, &second, &GicpParams::default()).unwrap();
        let at_centre = shift + turn.cross(&(found.centre - origin));
        for a in 0..3 {
            let sd = found.covariance[(a, a)].sqrt();
            assert!(
                (found.shift[a] - at_centre[a]).abs() < 4.0 * sd,
                "{} +- {sd}",
                found.shift[a]
            );
            assert!(sd < 5e-4);
            let sd = found.covariance[(3 + a, 3 + a)].sqrt();
            assert!((found.rotation[a] - turn[a]).abs() < 4.0 * sd);
        }
        // Ten metres away the rotation weighs more than the shift.
        let far = found.centre + Vector3::new(0.0, 10.0, 0.0);
        let error = shift + turn.cross(&(far - origin));
        let claimed = found.mean_square_at(&far);
        for a in 0..3 {
            assert!((claimed[(a, a)].sqrt() - error[a].abs()).abs() < 1e-3);
        }
    }

    #[test]
    fn one_plane_shows_no_motion_along_itself() {
        let plane = |seed| Cloud::from_world(Point3::origin(), corner(seed, 0.002).into_iter().take(8000));
        assert!(matches!(
            DatumError::of(&plane(1), &plane(2), &GicpParams::default()),
            Err(MotionFailure::Unobservable { .. })
        ));
        let empty = Cloud::new(Point3::origin(), Vec::new());
        assert!(matches!(
            DatumError::of(&empty, &plane(2), &GicpParams::default()),
            Err(MotionFailure::TooFewPoints { .. })
        ));
    }
}
