//! The alignment of one window.

use super::block::GicpBlock;
use super::pairing::Partner;
use super::params::{GicpParams, GicpStart};
use super::uncertainty::{Uncertainty, uncertainty};
use crate::cloud::GridIndex;
use crate::geometry::Rigid3;
use crate::id::StoneId;
use crate::stone::{MotionFailure, PairResult, StoneMotion};
use nalgebra::{Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6};
use rayon::prelude::*;

/// A matched stone inside a pair of blocks.
#[derive(Clone, Debug)]
pub struct GicpStone {
    /// Stone of the first epoch.
    pub first: StoneId,
    /// Its partner in the second.
    pub second: StoneId,
    /// Centroid in the first epoch, world frame; the displacement is reported here.
    pub centroid: Point3<f64>,
    /// Centroid in the second epoch, world frame.
    pub centroid_second: Point3<f64>,
    /// The stone's points, as indices into the first block.
    pub points: Vec<u32>,
    /// Number of the partner's points.
    pub points_second: usize,
}

/// Measures stones one by one: the motion of each with all points of the first block within
/// [`GicpParams::buffer_m`] of any of its points, onto the nearest points of the second block.
///
/// The blocks must hold all points within the buffer, and in the second epoch within
/// [`GicpParams::max_distance_m`] of where those go. The displacement of the centroid c is (R - I) c + t (Eq. 3 of
/// the paper). The covariance comes from the information of the final pairs and the scatter of their residuals, with
/// the slope that noise feigns taken off. The observability is the square root of the smallest over
/// the largest eigenvalue of that information for the displacement of the centroid, rotations free: for a face
/// seen from the front about the root mean square slope of its relief in the direction where it has least.
/// `relative` and `loose` are left empty, see [`super::relate_to_neighbours`].
///
/// Source: Segal, Haehnel & Thrun (2009). Results are in the order of `stones` and do not depend on threads.
/// Cost: some 20 to 100 passes over the window's points, each about 0.2 microseconds a point.
pub fn align(
    first: &GicpBlock,
    second: &GicpBlock,
    stones: &[GicpStone],
    params: &GicpParams,
) -> Vec<PairResult> {
    let measure = |stone: &GicpStone| PairResult {
        first: stone.first,
        second: stone.second,
        motion: align_one(first, second, stone, params),
    };
    stones.par_iter().map(measure).collect()
}

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

fn align_one(
    first: &GicpBlock,
    second: &GicpBlock,
    stone: &GicpStone,
    params: &GicpParams,
) -> Result<StoneMotion, MotionFailure> {
    if stone.points.len().min(stone.points_second) < params.min_points {
        return Err(MotionFailure::TooFewPoints {
            first: stone.points.len(),
            second: stone.points_second,
            needed: params.min_points,
        });
    }
    let mut window = window(first, stone, params.buffer_m);
    // The centroid in the second block's frame.
    let centre = Point3::from(stone.centroid - second.origin);
    let mut motion = Motion {
        shift: match params.start {
            GicpStart::Identity => Vector3::zeros(),
            GicpStart::Centroids => stone.centroid_second - stone.centroid,
        },
        turn: UnitQuaternion::identity(),
    };
    let needed = (params.min_overlap * window.len() as f64).max(params.min_points as f64);
    let mut settled = false;
    let (mut damping, mut last_step) = (1.0, Vector6::zeros());
    for _ in 0..params.max_iterations {
        let (mut h, mut g) = (Matrix6::zeros(), Vector6::zeros());
        let count = for_each_pair(
            &mut window,
            second,
            &centre,
            &motion,
            params.max_distance_m,
            |pair| {
                let weight = pair.weight(params.plane_epsilon);
                h += pair.information(&weight);
                g += pair.lever(&(weight * pair.residual));
            },
        );
        if (count as f64) < needed {
            return Err(MotionFailure::Disagreement);
        }
        // Partners change in jumps, so the balance may jump across zero without ever being zero. Steps that turn back
        // are halved: they close in on the place of the jump.
        damping = if g.dot(&last_step) < 0.0 {
            0.5 * damping
        } else {
            f64::min(1.02 * damping, 1.0)
        };
        let step = h.cholesky().ok_or(MotionFailure::NotConverged)?.solve(&g) * damping;
        last_step = step;
        let (shift, turn) = (
            step.fixed_rows::<3>(0).into_owned(),
            step.fixed_rows::<3>(3).into_owned(),
        );
        motion.shift += shift;
        motion.turn = UnitQuaternion::from_scaled_axis(turn) * motion.turn;
        if shift.norm() < params.tolerance_m && turn.norm() < params.tolerance_rad {
            settled = true;
            break;
        }
    }
    if !settled {
        return Err(MotionFailure::NotConverged);
    }
    let uncertainty = uncertainty(&mut window, second, &centre, &motion, params)?;
    Ok(stone_motion(stone, &motion, &uncertainty))
}

/// Points within the buffer around the stone's points.
fn window(first: &GicpBlock, stone: &GicpStone, buffer_m: f64) -> Vec<WindowPoint> {
    let centre = Point3::from(stone.centroid - first.origin);
    let point = |i: usize| WindowPoint {
        arm: first.points[i] - centre,
        normal: first.normals[i],
        partner: Partner::unknown(),
    };
    if buffer_m <= 0.0 {
        return stone.points.iter().map(|&i| point(i as usize)).collect();
    }
    let own: Vec<Point3<f64>> = stone.points.iter().map(|&i| first.points[i as usize]).collect();
    let radius = own.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max);
    let shape = GridIndex::new(&own, 0.25 * buffer_m);
    let mut inside: Vec<usize> = Vec::new();
    first.index.positions_within(&centre, radius + buffer_m, |i, p| {
        let surely = (p - centre).norm() <= buffer_m - radius;
        if surely || shape.nearest(p, buffer_m).is_some() {
            inside.push(i);
        }
    });
    inside.sort_unstable();
    inside.into_iter().map(point).collect()
}

fn stone_motion(stone: &GicpStone, motion: &Motion, uncertainty: &Uncertainty) -> StoneMotion {
    let arm = stone.centroid.coords;
    StoneMotion {
        second_from_first: Rigid3::from_parts(
            Translation3::from(arm + motion.shift - motion.turn * arm),
            motion.turn,
        ),
        displacement: motion.shift,
        rotation: motion.turn.scaled_axis(),
        covariance: uncertainty.covariance,
        relative: Vector3::zeros(),
        own_motion_p: 1.0,
        relative_covariance: Matrix3::zeros(),
        loose: false,
        observability: uncertainty.observability,
        rmse_m: uncertainty.rmse_m,
    }
}
