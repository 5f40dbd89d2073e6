//! The window of a stone: the points that are aligned, and their partners under a motion.

use super::block::GicpBlock;
use super::pairing::Partner;
use crate::cloud::GridIndex;
use nalgebra::{Matrix3, Matrix6, Point3, UnitQuaternion, Vector3, Vector6};

/// Points of a stone that are compared first.
const FEW: usize = 64;

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

impl Motion {
    /// This motion and a small step (displacement, rotation) after it.
    pub fn after(&self, step: &Vector6<f64>) -> Self {
        let turn = step.fixed_rows::<3>(3).into_owned();
        Self {
            shift: self.shift + step.fixed_rows::<3>(0),
            turn: UnitQuaternion::from_scaled_axis(turn) * self.turn,
        }
    }
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
    /// Inverse of the sum of both planes' covariances, `2 I - (1 - epsilon) (n n' + m m')`, by the formula of
    /// Sherman, Morrison & Woodbury.
    pub fn weight(&self, epsilon: f64) -> Matrix3<f64> {
        let (n, m) = (&self.normal, &self.normal_second);
        let share = 1.0 - epsilon;
        let (across, alike) = (2.0 - share, share * n.dot(m));
        let scale = 0.5 * share / (across * across - alike * alike);
        let [own, other] = [across, alike].map(|part| part * scale);
        let (u, v) = (n * own + m * other, n * other + m * own);
        let weight = |a: usize, b: usize| n[a] * u[b] + m[a] * v[b];
        let [xy, yz, zx] = [weight(0, 1), weight(1, 2), weight(2, 0)];
        let [xx, yy, zz] = [0, 1, 2].map(|a| 0.5 + weight(a, a));
        Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz)
    }

    /// Weighted vector of (displacement, rotation) that a pull at this point's place acts with.
    pub fn lever(&self, pull: &Vector3<f64>) -> Vector6<f64> {
        let moment = self.arm.cross(pull);
        Vector6::new(pull.x, pull.y, pull.z, moment.x, moment.y, moment.z)
    }
}

/// Information on (displacement, rotation), summed over pairs.
#[derive(Default)]
pub(super) struct Information {
    /// On the displacement.
    shift: Matrix3<f64>,
    /// Rows of the rotation, columns of the displacement.
    cross: Matrix3<f64>,
    /// On the rotation.
    turn: Matrix3<f64>,
}

impl Information {
    /// Adds the information of a symmetric weight at the end of an arm: `[I, A]' W [I, A]` with `A` the
    /// transposed cross matrix of the arm.
    pub fn add(&mut self, arm: &Vector3<f64>, weight: &Matrix3<f64>) {
        let cross = Matrix3::from_columns(&[0, 1, 2].map(|i| arm.cross(&weight.column(i))));
        self.shift += weight;
        self.cross += cross;
        self.turn += Matrix3::from_columns(&[0, 1, 2].map(|i| arm.cross(&cross.row(i).transpose())));
    }

    /// The sum.
    pub fn matrix(&self) -> Matrix6<f64> {
        let mut h = Matrix6::zeros();
        h.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.shift);
        h.fixed_view_mut::<3, 3>(3, 0).copy_from(&self.cross);
        h.fixed_view_mut::<3, 3>(0, 3).copy_from(&self.cross.transpose());
        h.fixed_view_mut::<3, 3>(3, 3).copy_from(&self.turn);
        h
    }
}

/// Calls `visit` for every point that has a partner under `motion`, in order; returns how many there are.
pub(super) fn for_each_pair<'w>(
    window: impl IntoIterator<Item = &'w mut WindowPoint>,
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
                normal_second: second.normal(i),
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
        normal: first.normal(i),
        partner: Partner::unknown(),
    };
    if buffer_m <= 0.0 {
        return stone.iter().map(|&i| point(i as usize)).collect();
    }
    let own: Vec<Point3<f64>> = stone.iter().map(|&i| first.points[i as usize]).collect();
    let radius = own.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max);
    let shape = GridIndex::new(&own, 0.25 * buffer_m);

    // For most points one of a few points of the stone is near enough; only the others need a search.
    let few: Vec<Point3<f64>> = own
        .iter()
        .step_by(own.len().div_ceil(FEW).max(1))
        .copied()
        .collect();
    let mut inside: Vec<usize> = Vec::new();
    first.index.positions_within(&centre, radius + buffer_m, |i, p| {
        let surely = (p - centre).norm() <= buffer_m - radius;
        let is_near = |own: &Point3<f64>| (p - own).norm_squared() <= buffer_m * buffer_m;
        if surely || few.iter().any(is_near) || shape.any_within(p, buffer_m) {
            inside.push(i);
        }
    });

    inside.sort_unstable();
    inside.into_iter().map(point).collect()
}
