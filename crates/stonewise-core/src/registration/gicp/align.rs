//! The alignment of one window.

use super::block::GicpBlock;
use super::params::{GicpParams, GicpStart};
use super::uncertainty::{Uncertainty, uncertainty};
use super::window::{Motion, WindowPoint, for_each_pair, window_points};
use crate::geometry::Rigid3;
use crate::id::StoneId;
use crate::stone::{MotionFailure, PairResult, StoneMotion};
use nalgebra::{Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6};
use rayon::prelude::*;

/// Factor by which a damped step grows back in each iteration that does not turn back: slow, as partners on
/// the edge of a jump would set off the next swing.
const RECOVERY: f64 = 1.02;

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
    /// The stone's points, as indices into the cloud of the first block.
    pub points: Vec<u32>,
    /// Number of the partner's points.
    pub points_second: usize,
}

/// Measures stones one by one: the motion of each with all points of the first block within
/// [`GicpParams::buffer_m`] of any of its points, onto the nearest points of the second block.
///
/// The blocks must hold all points within the buffer, and in the second epoch within
/// [`GicpParams::max_distance_m`] of where those go. The displacement of the centroid c is (R - I) c + t (Eq.
/// 3 of the paper). The covariance comes from the information of the final pairs and the scatter of their
/// residuals, with the slope that noise feigns taken off. The observability is the square root of the
/// smallest over the largest eigenvalue of that information for the displacement of the centroid, rotations
/// free: for a face seen from the front about the root mean square slope of its relief in the direction where
/// it has least. `relative` and `loose` are left empty, see [`super::relate_to_neighbours`].
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
    let mut window = window_points(first, &stone.centroid, &stone.points, params.buffer_m);
    // The centroid in the second block's frame.
    let centre = Point3::from(stone.centroid - second.origin);
    let start = match params.start {
        GicpStart::Identity => Vector3::zeros(),
        GicpStart::Centroids => stone.centroid_second - stone.centroid,
    };
    let motion = iterate(&mut window, second, &centre, start, params)?;
    let uncertainty = uncertainty(&mut window, second, &centre, &motion, params)?;
    Ok(stone_motion(stone, &motion, &uncertainty))
}

/// Moves the window until its steps are within the tolerances. `start`: its first shift.
fn iterate(
    window: &mut [WindowPoint],
    second: &GicpBlock,
    centre: &Point3<f64>,
    start: Vector3<f64>,
    params: &GicpParams,
) -> Result<Motion, MotionFailure> {
    let mut motion = Motion {
        shift: start,
        turn: UnitQuaternion::identity(),
    };
    let needed = (params.min_overlap * window.len() as f64).max(params.min_points as f64);
    let (mut damping, mut last_step) = (1.0, Vector6::zeros());
    for _ in 0..params.max_iterations {
        let (mut h, mut g) = (Matrix6::zeros(), Vector6::zeros());
        let max_m = params.max_distance_m;
        let count = for_each_pair(window, second, centre, &motion, max_m, |pair| {
            let weight = pair.weight(params.plane_epsilon);
            h += pair.information(&weight);
            g += pair.lever(&(weight * pair.residual));
        });
        if (count as f64) < needed {
            return Err(MotionFailure::Disagreement);
        }
        // Partners change in jumps, so the balance may jump across zero without ever being zero. Steps that
        // turn back are halved: they close in on the place of the jump.
        damping = if g.dot(&last_step) < 0.0 {
            0.5 * damping
        } else {
            f64::min(RECOVERY * damping, 1.0)
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
            return Ok(motion);
        }
    }
    Err(MotionFailure::NotConverged)
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
        p_loose: None,
        observability: uncertainty.observability,
        rmse_m: uncertainty.rmse_m,
    }
}
