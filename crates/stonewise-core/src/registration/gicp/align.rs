//! The alignment of stones.

use super::block::{GicpBlock, GicpStone};
use super::params::GicpParams;
use super::uncertainty::uncertainty;
use super::window::Window;
use crate::geometry::Rigid3;
use crate::stone::{MotionFailure, PairResult, SharedParts, StoneMotion};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Measures stones one by one: the motion of each with all points of the first block within
/// [`GicpParams::buffer_m`] of any of its points, onto the nearest points of the second block.
///
/// The blocks must hold all points within the buffer, and in the second epoch within
/// [`GicpParams::max_distance_m`] of where those go. The displacement of the centroid c is (R - I) c + t (Eq.
/// 3 of the paper). The observability is the square root of the smallest over the largest eigenvalue of the
/// information on the displacement of the centroid, rotations free: for a face seen from the front about the
/// root mean square slope of its relief in the direction where it has least. `relative` and `loose` are left
/// empty, see [`super::relate_to_neighbours`].
///
/// Source: Segal, Haehnel & Thrun (2009). Results are in the order of `stones`. Cost: 7 passes over the window on
/// masonry in a scanner's points, 100 and more on smooth faces; each about 0.4 microseconds a point.
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
    let window = Window::new(first, second, stone, params);
    let motion = window.align()?;
    let pairs: Vec<_> = window.pairs(&motion).collect();
    let (covariance, observability) = uncertainty(&pairs, params)?;
    let squares: f64 = pairs.iter().map(|p| p.normal().dot(&p.residual).powi(2)).sum();
    let (shift, turn, centre) = (motion.translation.vector, motion.rotation, stone.centroid.coords);
    Ok(StoneMotion {
        second_from_first: Rigid3::from_parts((shift + centre - turn * centre).into(), turn),
        displacement: shift,
        rotation: turn.scaled_axis(),
        covariance,
        shared: SharedParts::default(),
        relative: Vector3::zeros(),
        relative_covariance: Matrix3::zeros(),
        loose: false,
        p_loose: None,
        observability,
        rmse_m: (squares / pairs.len() as f64).sqrt(),
    })
}
