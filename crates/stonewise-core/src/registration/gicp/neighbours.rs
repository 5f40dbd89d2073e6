//! Stones against their neighbours.

use super::params::GicpParams;
use crate::cloud::GridIndex;
use crate::statistics::{chi_square_p, component_median, discoveries};
use crate::stone::{PairResult, StoneMotion};
use nalgebra::{Matrix3, Point3, Vector3};
use std::f64::consts::FRAC_PI_2;

/// Variance of a normal variable over its squared median absolute deviation.
const MAD_TO_VARIANCE: f64 = 1.4826 * 1.4826;
/// A neighbour lies within this distance, metres: farther stones move by another part of the wall.
const FAR_M: f64 = 5.0;

/// Fills in `relative`, `relative_covariance` and `loose` of every measured stone.
///
/// `stones`: each with its centroid in the first epoch, world. The motion that a stone should have is the median, axis
/// by axis, of its nearest measured neighbours; its variance is that of a median of as many values (pi / 2k
/// times theirs), with the spread the neighbours really have. Loose are the stones whose difference is
/// significant with the false discovery rate controlled (Benjamini & Hochberg 1995).
pub fn relate_to_neighbours(stones: &mut [(Point3<f64>, PairResult)], params: &GicpParams) {
    let (places, mut motions): (Vec<Point3<f64>>, Vec<&mut StoneMotion>) = stones
        .iter_mut()
        .filter_map(|(place, result)| Some((*place, result.motion.as_mut().ok()?)))
        .unzip();
    let index = GridIndex::new(&places, 0.5);
    let absolute: Vec<(Vector3<f64>, Matrix3<f64>)> = motions
        .iter()
        .map(|m| (m.displacement, m.covariance.fixed_view::<3, 3>(0, 0).into_owned()))
        .collect();
    let mut p_values = Vec::with_capacity(motions.len());
    for (m, motion) in motions.iter_mut().enumerate() {
        let near = index.nearest_k(&places[m], params.neighbours + 1, FAR_M);
        let others = near.iter().filter(|n| n.0 != m).map(|n| absolute[n.0]);
        let (expected, covariance) = median_of(&others.collect::<Vec<_>>(), &absolute[m].0);
        motion.relative = motion.displacement - expected;
        motion.relative_covariance = absolute[m].1 + covariance;
        let factor = motion.relative_covariance.cholesky();
        let square = factor.map(|f| motion.relative.dot(&f.solve(&motion.relative)));
        p_values.push(Some(square.map_or(1.0, |square| chi_square_p(square, 3))));
    }
    for i in discoveries(&p_values, params.false_discovery_rate) {
        motions[i].loose = true;
    }
}

/// Median of motions with its covariance; a stone's own motion, which is then no evidence, where there are none.
fn median_of(motions: &[(Vector3<f64>, Matrix3<f64>)], own: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    if motions.is_empty() {
        return (*own, Matrix3::zeros());
    }
    let k = motions.len() as f64;
    let displacements: Vec<Vector3<f64>> = motions.iter().map(|m| m.0).collect();
    let median = component_median(&displacements);
    let apart: Vec<Vector3<f64>> = displacements.iter().map(|d| (d - median).abs()).collect();
    let spread = component_median(&apart).map(|d| MAD_TO_VARIANCE * d * d);
    let mean = motions.iter().map(|m| m.1).sum::<Matrix3<f64>>() / k;
    (median, (mean + Matrix3::from_diagonal(&spread)) * (FRAC_PI_2 / k))
}
