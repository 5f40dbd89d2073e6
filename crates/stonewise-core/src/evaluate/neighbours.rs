//! Motions of neighbours relative to each other.

use super::calibration::Calibration;
use super::external_truth::{Owned, TrueStone};
use super::sample::{EvaluationParams, MotionSample, StoneOutcome};
use super::score::{Directions, directions};
use crate::id::StoneId;
use crate::stone::NeighbourCovariance;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Errors of the differences between the displacements of neighbours, such as openings of joints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NeighbourScore {
    /// Pairs of neighbours.
    pub pairs: usize,
    /// Errors of the differences per direction of the first stone's face.
    pub errors: Directions,
    /// Whether the stated covariances of the differences are correct.
    pub calibration: Calibration,
}

/// Scores the differences between neighbours whose true stones are countable. `None` without such
/// neighbours.
pub fn score_neighbours(
    outcomes: &[Owned],
    stones: &[TrueStone],
    neighbours: &[NeighbourCovariance],
    params: &EvaluationParams,
) -> Option<NeighbourScore> {
    let samples = samples(outcomes, stones, neighbours, params);
    (!samples.is_empty()).then(|| NeighbourScore {
        pairs: samples.len(),
        errors: directions(&samples, params.outlier_m),
        calibration: Calibration::of(&MotionSample::claims(&samples)),
    })
}

/// The differences between neighbours whose true stones are countable, beside the truth.
pub(super) fn samples(
    outcomes: &[Owned],
    stones: &[TrueStone],
    neighbours: &[NeighbourCovariance],
    params: &EvaluationParams,
) -> Vec<MotionSample> {
    let true_stones: BTreeMap<StoneId, &TrueStone> = stones.iter().map(|s| (s.stone_id, s)).collect();
    let known: BTreeMap<StoneId, (&StoneOutcome, &TrueStone)> = outcomes
        .iter()
        .filter_map(|(outcome, owner)| Some((outcome.stone, (outcome, *true_stones.get(&(*owner)?)?))))
        .filter(|(_, (_, stone))| stone.is_countable(params))
        .collect();
    neighbours
        .iter()
        .filter_map(|pair| {
            let [first, second] = pair.stones.map(|id| known.get(&id));
            sample(&pair.covariance, [*first?, *second?])
        })
        .collect()
}

fn sample(
    covariance: &Matrix3<f64>,
    [(first, first_true), (second, second_true)]: [(&StoneOutcome, &TrueStone); 2],
) -> Option<MotionSample> {
    let truth = second_true.displacement_at(&second.centroid) - first_true.displacement_at(&first.centroid);
    let difference = StoneOutcome {
        displacement: Some(second.displacement? - first.displacement?),
        covariance: Some(*covariance),
        covariance_without_datum: Some(*covariance),
        ..first.clone()
    };
    MotionSample::of_stone(&difference, &first_true.normal, truth, None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};

    #[test]
    fn a_motion_that_neighbours_share_is_no_error_of_their_difference() {
        let shared = Vector3::new(0.02, -0.01, 0.03);
        let errors = [0.0, 1e-3, 4e-3];
        let outcome = |k: u32| StoneOutcome {
            stone: StoneId(k),
            centroid: Point3::new(0.0, f64::from(k), 0.0),
            normal: Vector3::x(),
            displacement: Some(shared + Vector3::new(0.0, errors[k as usize], 0.0)),
            covariance: Some(Matrix3::identity()),
            covariance_without_datum: None,
            rotation: None,
            datum_known: true,
            detection_limit_m: None,
            significant: None,
            loose: None,
        };
        let stone = |k: u32| TrueStone {
            stone_id: StoneId(k + 10),
            centroid: Point3::new(0.0, f64::from(k), 0.0),
            normal: Vector3::x(),
            displacement: Vector3::zeros(),
            rotation: Vector3::zeros(),
            loose: false,
            edge: false,
            visible_share: 1.0,
        };
        let outcomes: Vec<Owned> = (0..3).map(|k| (outcome(k), Some(StoneId(k + 10)))).collect();
        let stones: Vec<TrueStone> = (0..3).map(stone).collect();
        let pair = |a: u32, b: u32| NeighbourCovariance {
            stones: [StoneId(a), StoneId(b)],
            covariance: Matrix3::identity() * 1e-6,
        };
        let pairs = [pair(0, 1), pair(1, 2), pair(2, 7)];
        let params = EvaluationParams::default();
        let score = score_neighbours(&outcomes, &stones, &pairs, &params).unwrap();
        // Errors of 1 and 3 mm with a stated standard deviation of 1 mm.
        assert_eq!(score.pairs, 2);
        let along = score.errors.along.unwrap();
        assert!((along.rmse_m - 5e-6f64.sqrt()).abs() < 1e-12);
        assert!((score.calibration.chi_square_mean.unwrap() - 5.0).abs() < 1e-9);
        assert_eq!(score.calibration.coverage_95.along, Some(0.5));
        assert!(score_neighbours(&outcomes, &stones, &pairs[2..], &params).is_none());
    }
}
