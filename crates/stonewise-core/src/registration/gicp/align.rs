//! The alignment of one window.

use super::block::GicpBlock;
use super::params::{GicpParams, GicpStart};
use super::settle::Alignment;
use super::uncertainty::{Uncertainty, uncertainty};
use super::window::{Motion, window_points};
use crate::geometry::Rigid3;
use crate::id::StoneId;
use crate::stone::{MotionFailure, PairResult, StoneMotion};
use nalgebra::{Matrix3, Point3, Translation3, Vector3};
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
/// residuals, with the apparent slope of the noise taken off. The observability is the square root of the
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
        body: 0,
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
    let motion = Alignment::new(&mut window, second, centre, params).iterate(start)?;
    let uncertainty = uncertainty(&mut window, second, &centre, &motion, params)?;
    Ok(stone_motion(stone, &motion, &uncertainty))
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
