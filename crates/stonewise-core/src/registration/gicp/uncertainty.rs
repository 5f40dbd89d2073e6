//! How far an alignment can be trusted.
//!
//! At the solution the weighted residuals balance. How fast that balance changes with the motion is the
//! information G of the pairs; how much it scatters by chance is B. The covariance is then G^-1 B G^-1. Two
//! things correct that:
//! - Normals of noisy points lean, and lean like relief. Partners' normals differ by twice the variance of
//!   that lean, which tells its size; G is formed without it, and without the weight along the planes, which
//!   pulls a point to its neighbour however the surface moves.
//! - Residuals of points next to each other are alike: they share partners, and unevenness of the ground. B
//!   is the sum over single points, scaled by what the sums over small cells have more.

use super::block::GicpBlock;
use super::params::GicpParams;
use super::window::{Information, Motion, Pair, WindowPoint, for_each_pair};
use crate::geometry::floor;
use crate::statistics::upper_median;
use crate::stone::MotionFailure;
use nalgebra::{Matrix3, Matrix6, Point3, Vector3, Vector6};
use std::collections::BTreeMap;

/// Covariance of (displacement, rotation), and what else is said about an alignment.
pub(super) struct Uncertainty {
    pub covariance: Matrix6<f64>,
    pub observability: f64,
    pub rmse_m: f64,
}

/// Median over mean of a chi-square variable of two degrees of freedom.
const MEDIAN_OF_CHI2_2: f64 = std::f64::consts::LN_2;

/// Uncertainty of the final motion of a window; `Unobservable` where the relief does not hold it in a
/// direction.
pub(super) fn uncertainty(
    window: &mut [WindowPoint],
    second: &GicpBlock,
    centre: &Point3<f64>,
    motion: &Motion,
    params: &GicpParams,
) -> Result<Uncertainty, MotionFailure> {
    let max = params.max_distance_m;
    let mut leans = Vec::with_capacity(window.len());
    let count = for_each_pair(&mut *window, second, centre, motion, max, |pair| {
        leans.push(lean(pair).norm_squared());
    });
    let lean_variance = feigned_slope_variance(&mut leans);

    let (mut gain, mut scatter, mut squares) = (Information::default(), Matrix6::zeros(), 0.0);
    let mut cells = CellSums::default();
    for_each_pair(window, second, centre, motion, max, |pair| {
        let weight = pair.weight(params.plane_epsilon);
        let normal = mean_normal(pair);
        gain.add(&pair.arm, &shape_weight(&weight, &normal, lean_variance));
        let score = pair.lever(&(weight * pair.residual));
        scatter += score * score.transpose();
        squares += normal.dot(&pair.residual).powi(2);
        let cell = [0, 1, 2].map(|a| floor(pair.arm[a] / params.correlation_cell_m));
        cells.add(cell, &score);
    });
    let gain = gain.matrix();
    let observability = observability(&gain, params.min_observability)?;
    let inverse = gain.try_inverse().ok_or(MotionFailure::NotConverged)?;
    let excess = correlation(&scatter, &cells.finish());
    let covariance = inverse * scatter * inverse * excess;
    Ok(Uncertainty {
        covariance: (covariance + covariance.transpose()) * 0.5,
        observability,
        rmse_m: (squares / count as f64).sqrt(),
    })
}

/// Sums over cells. Runs of points in the same cell take one look-up.
#[derive(Default)]
struct CellSums {
    sums: BTreeMap<[i64; 3], Vector6<f64>>,
    last: Option<([i64; 3], Vector6<f64>)>,
}

impl CellSums {
    fn add(&mut self, cell: [i64; 3], score: &Vector6<f64>) {
        match &mut self.last {
            Some((same, sum)) if *same == cell => *sum += score,
            _ => {
                let before = self.last.replace((cell, *score));
                self.enter(before);
            }
        }
    }

    fn enter(&mut self, summed: Option<([i64; 3], Vector6<f64>)>) {
        if let Some((cell, sum)) = summed {
            *self.sums.entry(cell).or_default() += sum;
        }
    }

    fn finish(mut self) -> BTreeMap<[i64; 3], Vector6<f64>> {
        let last = self.last.take();
        self.enter(last);
        self.sums
    }
}

/// Difference of partners' normals, signs made equal.
fn lean(pair: &Pair) -> Vector3<f64> {
    if pair.normal.dot(&pair.normal_second) < 0.0 {
        pair.normal + pair.normal_second
    } else {
        pair.normal - pair.normal_second
    }
}

fn mean_normal(pair: &Pair) -> Vector3<f64> {
    let sum = if pair.normal.dot(&pair.normal_second) < 0.0 {
        pair.normal - pair.normal_second
    } else {
        pair.normal + pair.normal_second
    };
    sum.normalize()
}

/// Variance, per direction, of the lean that noise gives to the mean of two partners' normals.
///
/// Half the sum of two errors varies as half their difference does. The median leaves out edges, where
/// partners' normals differ because the surface bends.
fn feigned_slope_variance(leans: &mut [f64]) -> f64 {
    upper_median(leans).map_or(0.0, |median| median / (2.0 * MEDIAN_OF_CHI2_2) / 4.0)
}

/// The part of a pair's weight that the shape of the surface answers for.
fn shape_weight(weight: &Matrix3<f64>, normal: &Vector3<f64>, lean_variance: f64) -> Matrix3<f64> {
    let along_planes = 0.5;
    let across = weight - Matrix3::identity() * along_planes;
    let tangent = Matrix3::identity() - normal * normal.transpose();
    across - tangent * (across.trace() * lean_variance)
}

/// Root of smallest over largest information on the displacement, rotations free.
fn observability(gain: &Matrix6<f64>, least: f64) -> Result<f64, MotionFailure> {
    let shift = gain.fixed_view::<3, 3>(0, 0).into_owned();
    let cross = gain.fixed_view::<3, 3>(3, 0).into_owned();
    let turn = gain.fixed_view::<3, 3>(3, 3).into_owned();
    let own = match turn.cholesky() {
        Some(factor) => shift - cross.transpose() * factor.solve(&cross),
        None => shift,
    };
    let eigen = own.symmetric_eigen();
    let (low, high) = (eigen.eigenvalues.imin(), eigen.eigenvalues.max());
    let share = (eigen.eigenvalues[low].max(0.0) / high.max(f64::MIN_POSITIVE)).sqrt();
    if turn.cholesky().is_none() || share < least {
        return Err(MotionFailure::Unobservable {
            direction: eigen.eigenvectors.column(low).into_owned(),
        });
    }
    Ok(share)
}

/// How much more the sums over cells scatter than independent points would: 1 or more.
fn correlation(single: &Matrix6<f64>, cells: &BTreeMap<[i64; 3], Vector6<f64>>) -> f64 {
    let Some(factor) = single.cholesky() else {
        return 1.0;
    };
    let (mut sum, mut count) = (0.0, 0.0);
    for score in cells.values() {
        sum += score.dot(&factor.solve(score));
        count += 1.0;
    }
    // Six sums are zero at the solution, so that the cells show that much less than they hold.
    let seen = (count - 6.0_f64).max(1.0) / f64::max(count, 1.0);
    (sum / 6.0 / seen).max(1.0)
}
