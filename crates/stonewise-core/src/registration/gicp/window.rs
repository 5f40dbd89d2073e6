//! The window of a stone: the points that are aligned, and the motion that brings them onto their partners.

use super::block::{GicpBlock, GicpStone};
use super::params::GicpParams;
use crate::cloud::GridIndex;
use crate::geometry::{Rigid3, lever};
use crate::stone::MotionFailure;
use nalgebra::{Matrix3, Matrix6, Point3, UnitQuaternion, Vector3, Vector6};

/// Factor by which a damped step grows back in each iteration that does not turn back: slow, as partners on
/// the edge of a jump would set off the next swing.
const RECOVERY: f64 = 1.02;

/// Smallest cell in which the points of a stone are sought, metres.
const SHAPE_CELL_M: f64 = 0.01;

/// The points around a stone, to be moved onto the second epoch.
pub(super) struct Window<'a> {
    /// Arms from the stone's centroid and normals, in the first epoch.
    pub points: Vec<[Vector3<f64>; 2]>,
    second: &'a GicpBlock,
    /// Centroid of the stone in the frame of the second block.
    centre: Point3<f64>,
    params: &'a GicpParams,
}

/// A point with its partner under some motion.
pub(super) struct Pair {
    /// Turned arm.
    pub arm: Vector3<f64>,
    /// Turned normal of the first epoch, and that of the partner, with equal signs.
    pub normals: [Vector3<f64>; 2],
    /// From the moved point to its partner.
    pub residual: Vector3<f64>,
}

impl Pair {
    /// Mean of both normals, of unit length.
    pub fn normal(&self) -> Vector3<f64> {
        (self.normals[0] + self.normals[1]).normalize()
    }

    /// Inverse of the sum of both planes' covariances.
    pub fn weight(&self, epsilon: f64) -> Matrix3<f64> {
        let [n, m] = &self.normals;
        let across = n * n.transpose() + m * m.transpose();
        let covariance = Matrix3::identity() * 2.0 - across * (1.0 - epsilon);
        covariance.try_inverse().unwrap_or_default()
    }
}

impl<'a> Window<'a> {
    /// All points of the first block within the buffer around any of the stone's points.
    pub fn new(first: &GicpBlock, second: &'a GicpBlock, stone: &GicpStone, params: &'a GicpParams) -> Self {
        let centre = Point3::from(stone.centroid - first.origin);
        let kept = |i: &u32| Some(first.points[first.kept.binary_search(i).ok()?]);
        let own: Vec<Point3<f64>> = stone.points.iter().filter_map(kept).collect();
        let shape = GridIndex::new(&own, f64::max(0.25 * params.buffer_m, SHAPE_CELL_M));
        let all = first.points.iter().zip(&first.normals);
        let inside = all.filter(|(p, _)| shape.any_within(p, params.buffer_m));
        Self {
            points: inside.map(|(p, normal)| [p - centre, *normal]).collect(),
            second,
            centre: Point3::from(stone.centroid - second.origin),
            params,
        }
    }

    /// The motion about the centroid at which the weighted residuals of all pairs balance: steps of Gauss and
    /// Newton from no motion, until one moves no point by more than the tolerance.
    ///
    /// Partners change in jumps, so the balance may jump across zero without ever being zero. Steps that turn
    /// back are halved: they close in on the place of the jump.
    pub fn align(&self) -> Result<Rigid3, MotionFailure> {
        let radius_m = self.points.iter().map(|[arm, _]| arm.norm()).fold(0.0, f64::max);
        let needed = self.params.min_overlap * self.points.len() as f64;
        let needed = needed.max(self.params.min_points as f64);
        let (mut motion, mut damping, mut step) = (Rigid3::identity(), 1.0, Vector6::zeros());
        for _ in 0..self.params.max_iterations {
            let (mut information, mut pull, mut count) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
            for pair in self.pairs(&motion) {
                let lever = lever(&pair.arm);
                let weighted = lever.transpose() * pair.weight(self.params.plane_epsilon);
                information += weighted * lever;
                pull += weighted * pair.residual;
                count += 1.0;
            }
            if count < needed {
                return Err(MotionFailure::Disagreement);
            }
            let factor = information.cholesky().ok_or(MotionFailure::NotConverged)?;
            damping = match pull.dot(&step) < 0.0 {
                true => 0.5 * damping,
                false => f64::min(RECOVERY * damping, 1.0),
            };
            step = factor.solve(&pull) * damping;
            let (shift, turn) = (step.fixed_rows::<3>(0), step.fixed_rows::<3>(3));
            motion.translation.vector += shift;
            motion.rotation = UnitQuaternion::from_scaled_axis(turn.into_owned()) * motion.rotation;
            if shift.norm() + radius_m * turn.norm() < self.params.tolerance_m {
                return Ok(motion);
            }
        }
        Err(MotionFailure::NotConverged)
    }

    /// Every point that has a partner under a motion, in order.
    pub fn pairs(&self, motion: &Rigid3) -> impl Iterator<Item = Pair> {
        let (second, max_m) = (self.second, self.params.max_distance_m);
        let rotation = motion.rotation.to_rotation_matrix();
        let place = self.centre + motion.translation.vector;
        self.points.iter().filter_map(move |[arm, normal]| {
            let (arm, normal) = (rotation * arm, rotation * normal);
            let (partner, _) = second.index.nearest(&(place + arm), max_m)?;
            let other = second.normals[partner];
            Some(Pair {
                arm,
                normals: [normal, other * normal.dot(&other).signum()],
                residual: second.points[partner] - (place + arm),
            })
        })
    }
}
