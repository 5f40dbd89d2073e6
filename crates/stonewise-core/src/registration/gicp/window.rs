//! The window of a stone: the points that are aligned, and their partners under a motion.

use super::block::GicpBlock;
use super::pairing::Partner;
use crate::cloud::GridIndex;
use nalgebra::{Matrix3, Matrix6, Point3, UnitQuaternion, Vector3, Vector6};

/// A point of the window: its arm from the centroid and its normal, both in the first epoch.
pub(super) struct WindowPoint {
    pub arm: Vector3<f64>,
    pub normal: Vector3<f64>,
    pub partner: Partner,
}

/// A rigid motion about the centroid.
#[derive(Clone, Copy)]
pub(super) struct Motion {
    pub shift: Vector3<f64>,
    pub turn: UnitQuaternion<f64>,
}

/// A point with its partner under some motion.
pub(super) struct Pair {
    /// Turned arm.
    pub arm: Vector3<f64>,
    /// Turned normal of the first epoch.
    pub normal: Vector3<f64>,
    /// Normal of the partner.
    pub normal_second: Vector3<f64>,
    /// From the moved point to its partner.
    pub residual: Vector3<f64>,
}

impl Pair {
    /// Inverse of the sum of both planes' covariances.
    pub fn weight(&self, epsilon: f64) -> Matrix3<f64> {
        let (n, m) = (&self.normal, &self.normal_second);
        let sum = Matrix3::identity() * 2.0 - (n * n.transpose() + m * m.transpose()) * (1.0 - epsilon);
        sum.try_inverse().unwrap_or_else(Matrix3::zeros)
    }

    /// Weighted vector of (displacement, rotation) that a pull at this point's place acts with.
    pub fn lever(&self, pull: &Vector3<f64>) -> Vector6<f64> {
        let moment = self.arm.cross(pull);
        Vector6::new(pull.x, pull.y, pull.z, moment.x, moment.y, moment.z)
    }

    /// Information on (displacement, rotation) of a weight at this point's place.
    pub fn information(&self, weight: &Matrix3<f64>) -> Matrix6<f64> {
        let cross = self.arm.cross_matrix();
        let lower = cross * weight;
        let mut h = Matrix6::zeros();
        h.fixed_view_mut::<3, 3>(0, 0).copy_from(weight);
        h.fixed_view_mut::<3, 3>(3, 0).copy_from(&lower);
        h.fixed_view_mut::<3, 3>(0, 3).copy_from(&lower.transpose());
        h.fixed_view_mut::<3, 3>(3, 3).copy_from(&-(lower * cross));
        h
    }
}

/// Calls `visit` for every point that has a partner under `motion`, in order; returns how many there are.
pub(super) fn for_each_pair(
    window: &mut [WindowPoint],
    second: &GicpBlock,
    centre: &Point3<f64>,
    motion: &Motion,
    max_m: f64,
    mut visit: impl FnMut(&Pair),
) -> usize {
    let rotation = motion.turn.to_rotation_matrix();
    let place = centre + motion.shift;
    let mut count = 0;
    for point in window {
        let arm = rotation * point.arm;
        if let Some((i, residual)) = point.partner.find(second, &(place + arm), max_m) {
            count += 1;
            visit(&Pair {
                arm,
                normal: rotation * point.normal,
                normal_second: second.normals[i],
                residual,
            });
        }
    }
    count
}

/// Points within the buffer around the stone's points.
///
/// `centroid`: of the stone, world; `stone`: its points, as indices into the cloud that the block was made
/// from.
pub(super) fn window_points(
    first: &GicpBlock,
    centroid: &Point3<f64>,
    stone: &[u32],
    buffer_m: f64,
) -> Vec<WindowPoint> {
    let centre = Point3::from(centroid - first.origin);
    let stone = first.standing_for(stone);
    let point = |i: usize| WindowPoint {
        arm: first.points[i] - centre,
        normal: first.normals[i],
        partner: Partner::unknown(),
    };
    if buffer_m <= 0.0 {
        return stone.iter().map(|&i| point(i as usize)).collect();
    }
    let own: Vec<Point3<f64>> = stone.iter().map(|&i| first.points[i as usize]).collect();
    let radius = own.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max);
    let shape = GridIndex::new(&own, 0.25 * buffer_m);
    let mut inside: Vec<usize> = Vec::new();
    first.index.positions_within(&centre, radius + buffer_m, |i, p| {
        let surely = (p - centre).norm() <= buffer_m - radius;
        if surely || shape.any_within(p, buffer_m) {
            inside.push(i);
        }
    });
    inside.sort_unstable();
    inside.into_iter().map(point).collect()
}
