//! How far an alignment can be trusted.
//!
//! At the solution the weighted residuals balance. How fast that balance changes with the motion is the
//! information G of the pairs; how much it scatters by chance is B. The covariance is then G^-1 B G^-1.
//! - Normals of noisy points lean, and lean like relief. Partners' normals differ by twice the variance of
//!   that lean, which tells its size; G is formed without it, and without the weight along the planes, which
//!   pulls a point to its neighbour however the surface moves.
//! - Neighbouring residuals are alike: B is summed over small cells, not over points.

use super::params::GicpParams;
use super::window::Pair;
use crate::geometry::{cell_of, lever};
use crate::statistics::upper_median;
use crate::stone::MotionFailure;
use nalgebra::{Matrix3, Matrix6, Point3, Vector6};
use std::collections::BTreeMap;
use std::f64::consts::LN_2;

/// Covariance of a motion (displacement, rotation) and its observability, from the pairs under it; `Unobservable` where
/// the relief does not hold it in a direction.
pub(super) fn uncertainty(pairs: &[Pair], params: &GicpParams) -> Result<(Matrix6<f64>, f64), MotionFailure> {
    let lean_variance = lean_variance(pairs);
    let mut gain = Matrix6::zeros();
    let mut cells: BTreeMap<[i64; 3], Vector6<f64>> = BTreeMap::new();
    for pair in pairs {
        let (lever, weight) = (lever(&pair.arm), pair.weight(params.plane_epsilon));
        let normal = pair.normal();
        // The part of the weight that the shape of the surface answers for.
        let across = weight - Matrix3::identity() * 0.5;
        let tangent = Matrix3::identity() - normal * normal.transpose();
        gain += lever.transpose() * (across - tangent * (across.trace() * lean_variance)) * lever;
        let cell = cell_of(&Point3::from(pair.arm), params.correlation_cell_m);
        *cells.entry(cell).or_default() += lever.transpose() * (weight * pair.residual);
    }
    let observability = observability(&gain, params.min_observability)?;
    // Six sums are zero at the solution, so that the cells show that much less than they hold.
    let seen = (cells.len() as f64 - 6.0).max(1.0) / cells.len() as f64;
    let scatter = cells
        .values()
        .map(|sum| sum * sum.transpose())
        .sum::<Matrix6<f64>>()
        / seen;
    let inverse = gain.try_inverse().ok_or(MotionFailure::NotConverged)?;
    let covariance = inverse * scatter * inverse;
    Ok(((covariance + covariance.transpose()) * 0.5, observability))
}

/// Variance, per direction, of the lean that noise gives to the mean of two partners' normals.
///
/// Half the sum of two errors varies as half their difference does. The median, of a chi-square variable of two
/// degrees of freedom, leaves out edges, where partners' normals differ because the surface bends.
fn lean_variance(pairs: &[Pair]) -> f64 {
    let lean = |pair: &Pair| (pair.normals[0] - pair.normals[1]).norm_squared();
    let mut leans: Vec<f64> = pairs.iter().map(lean).collect();
    upper_median(&mut leans).map_or(0.0, |median| median / (2.0 * LN_2) / 4.0)
}

/// Root of smallest over largest information on the displacement, rotations free.
fn observability(gain: &Matrix6<f64>, least: f64) -> Result<f64, MotionFailure> {
    let shift = gain.fixed_view::<3, 3>(0, 0).into_owned();
    let cross = gain.fixed_view::<3, 3>(3, 0).into_owned();
    let turn = gain.fixed_view::<3, 3>(3, 3).cholesky();
    let free = turn
        .as_ref()
        .map(|factor| cross.transpose() * factor.solve(&cross));
    let eigen = (shift - free.unwrap_or_default()).symmetric_eigen();
    let (low, high) = (eigen.eigenvalues.imin(), eigen.eigenvalues.max());
    let share = (eigen.eigenvalues[low].max(0.0) / high.max(f64::MIN_POSITIVE)).sqrt();
    match turn.is_none() || share < least {
        true => Err(MotionFailure::Unobservable {
            direction: eigen.eigenvectors.column(low).into_owned(),
        }),
        false => Ok(share),
    }
}
