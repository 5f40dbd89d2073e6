//! Stones against their neighbours.

use super::params::GicpParams;
use crate::cloud::GridIndex;
use crate::statistics::{discoveries, median};
use crate::stone::{PairResult, StoneMotion};
use nalgebra::{Matrix3, Point3, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::f64::consts::FRAC_PI_2;

/// Variance of a normal variable over its squared median absolute deviation.
const MAD_TO_VARIANCE: f64 = 1.4826 * 1.4826;
/// A neighbour lies within this distance, metres: farther stones move by another part of the wall.
const FAR_M: f64 = 5.0;

/// Fills in `relative`, `relative_covariance`, `own_motion_p` and `loose` of every measured stone.
///
/// `stones`: each with its centroid in the first epoch, world. The motion that a stone should have is the median, axis
/// by axis, of its nearest measured neighbours; its variance is that of a median of as many values (pi / 2k
/// times theirs), with the spread the neighbours really have. Loose are the stones whose difference is
/// significant with the false discovery rate controlled (Benjamini & Hochberg 1995).
pub fn relate_to_neighbours(stones: &mut [(Point3<f64>, PairResult)], params: &GicpParams) {
    let measured: Vec<usize> = (0..stones.len())
        .filter(|&i| stones[i].1.motion.is_ok())
        .collect();
    let places: Vec<Point3<f64>> = measured.iter().map(|&i| stones[i].0).collect();
    let index = GridIndex::new(&places, 0.5);
    let relatives: Vec<Option<(Vector3<f64>, Matrix3<f64>)>> = (0..measured.len())
        .map(|m| {
            let motion = |m: usize| stones[measured[m]].1.motion.as_ref().ok();
            let others: Vec<&StoneMotion> = index
                .nearest_k(&places[m], params.neighbours + 1, FAR_M)
                .iter()
                .filter(|n| n.0 != m)
                .filter_map(|n| motion(n.0))
                .collect();
            Some(relative(motion(m)?, &others))
        })
        .collect();

    let mut tests = vec![None; stones.len()];
    for (&i, found) in measured.iter().zip(relatives) {
        if let (Ok(motion), Some((difference, covariance))) = (&mut stones[i].1.motion, found) {
            motion.relative = difference;
            motion.relative_covariance = covariance;
            motion.own_motion_p = p_value(&difference, &covariance);
            tests[i] = Some(motion.own_motion_p);
        }
    }

    for i in discoveries(&tests, params.false_discovery_rate) {
        if let Ok(motion) = &mut stones[i].1.motion {
            motion.loose = true;
        }
    }
}

fn relative(own: &StoneMotion, others: &[&StoneMotion]) -> (Vector3<f64>, Matrix3<f64>) {
    let own_covariance = own.covariance.fixed_view::<3, 3>(0, 0).into_owned();
    if others.is_empty() {
        return (Vector3::zeros(), own_covariance);
    }
    let k = others.len() as f64;
    let expected = Vector3::from_fn(|axis, _| middle(others.iter().map(|o| o.displacement[axis])));
    let spread = Vector3::from_fn(|axis, _| {
        let deviations = others
            .iter()
            .map(|o| (o.displacement[axis] - expected[axis]).abs());
        MAD_TO_VARIANCE * middle(deviations).powi(2)
    });
    let mean: Matrix3<f64> = others
        .iter()
        .map(|o| o.covariance.fixed_view::<3, 3>(0, 0).into_owned())
        .sum::<Matrix3<f64>>()
        / k;
    let of_median = (mean + Matrix3::from_diagonal(&spread)) * (FRAC_PI_2 / k);
    (own.displacement - expected, own_covariance + of_median)
}

fn middle(values: impl Iterator<Item = f64>) -> f64 {
    median(&mut values.collect::<Vec<f64>>()).unwrap_or(0.0)
}

/// Probability of so large a difference by chance.
fn p_value(difference: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
    let (Some(factor), Ok(law)) = (covariance.cholesky(), ChiSquared::new(3.0)) else {
        return 1.0;
    };
    law.sf(difference.dot(&factor.solve(difference)))
}
