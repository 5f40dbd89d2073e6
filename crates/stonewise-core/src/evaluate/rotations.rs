//! Rotations of stones against the truth.

use super::calibration::{Calibration, Claim};
use super::external_truth::{Owned, Rows, TrueStone};
use super::sample::{
    EvaluationParams, MotionSample, RotationEstimate, StoneOutcome, half_widths, normalised,
};
use super::statistics::ErrorStatistics;
use crate::geometry::{FaceFrame, SmallMotion};
use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};

/// How accurate the rotations of stones are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RotationScore {
    /// Countable stones with a rotation.
    pub estimated: usize,
    /// Errors about the axes of the true face.
    pub errors: RotationAxes,
    /// Errors after the rotations of the common rigid motions of estimates and of truths are subtracted.
    pub errors_without_datum: RotationAxes,
    /// Whether the stated covariances are correct; `None` where the datum is unknown. `coverage_95.along` is
    /// the coverage of the rotation about the axis along the dam, and so on.
    pub calibration: Option<Calibration>,
    /// Whether the covariances without the registration error are correct for rotations relative to the common rigid
    /// motion.
    pub calibration_without_datum: Calibration,
}

/// Statistics of the errors of rotation vectors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RotationAxes {
    /// About the axis along the dam, signed: tilt outwards or inwards.
    pub about_along: Option<RotationStatistics>,
    /// About the axis up the face, signed.
    pub about_up: Option<RotationStatistics>,
    /// About the outward normal, signed: rotation in the plane of the face.
    pub about_out: Option<RotationStatistics>,
    /// Angle between the estimated and the true orientation.
    pub angle: Option<RotationStatistics>,
}

/// What the errors of rotations look like, milliradians.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RotationStatistics {
    /// Number of errors.
    pub count: usize,
    /// Root of the mean square.
    pub rmse_mrad: f64,
    /// Mean: the bias of a signed component.
    pub mean_mrad: f64,
    /// Median of the errors with their sign.
    pub median_mrad: f64,
    /// 1.4826 times the median distance from the median.
    pub nmad_mrad: f64,
    /// 95th percentile of the absolute errors.
    pub p95_mrad: f64,
    /// RMSE of an estimator that always reports no rotation.
    pub zero_predictor_rmse_mrad: f64,
}

impl RotationStatistics {
    /// Statistics of errors and of truths, radians; `None` without errors.
    fn of(errors: &[f64], truths: &[f64]) -> Option<Self> {
        let s = ErrorStatistics::of(errors, truths, f64::INFINITY)?;
        Some(Self {
            count: s.count,
            rmse_mrad: 1e3 * s.rmse_m,
            mean_mrad: 1e3 * s.mean_m,
            median_mrad: 1e3 * s.median_m,
            nmad_mrad: 1e3 * s.nmad_m,
            p95_mrad: 1e3 * s.p95_m,
            zero_predictor_rmse_mrad: 1e3 * s.zero_predictor_rmse_m,
        })
    }
}

/// An estimated rotation vector beside the true one, in axes of the true face (along, up, out), radians.
struct RotationSample {
    error: Vector3<f64>,
    truth: Vector3<f64>,
    covariance: Matrix3<f64>,
}

impl RotationSample {
    /// `covariance`: of the estimate, world, rad^2.
    fn new(
        normal: &Vector3<f64>,
        estimated: Vector3<f64>,
        truth: Vector3<f64>,
        covariance: &Matrix3<f64>,
    ) -> Self {
        let face = FaceFrame::from_normal(normal).face_from_world();
        let error = Rotation3::from_scaled_axis(estimated) * Rotation3::from_scaled_axis(truth).inverse();
        Self {
            error: face * error.scaled_axis(),
            truth: face * truth,
            covariance: face * covariance * face.transpose(),
        }
    }

    fn claim(&self) -> Claim {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        Claim {
            error: self.error,
            half_width: half_widths(&axes, Some(&self.covariance)),
            normalised: normalised(&self.error, Some(&self.covariance)),
        }
    }
}

/// Scores the rotations of countable stones. `None` without rotations.
///
/// The error is the rotation vector from the true to the estimated orientation; the rotation of a rigid stone
/// does not depend on its centroid. The common rigid motions are those fitted to the displacements.
pub fn score_rotations(
    outcomes: &[Owned],
    stones: &[TrueStone],
    params: &EvaluationParams,
) -> Option<RotationScore> {
    let rows = Rows::new(outcomes, stones).of_stone;
    let found: Vec<(&StoneOutcome, &TrueStone)> = stones
        .iter()
        .filter(|s| s.is_countable(params))
        .filter_map(|s| Some((*rows.get(&s.stone_id)?, s)))
        .collect();
    let turned: Vec<(&StoneOutcome, &TrueStone, &RotationEstimate)> = found
        .iter()
        .filter_map(|&(outcome, stone)| Some((outcome, stone, outcome.rotation.as_ref()?)))
        .collect();
    if turned.is_empty() {
        return None;
    }
    let samples: Vec<MotionSample> = found
        .iter()
        .filter_map(|(o, s)| MotionSample::of_stone(o, &s.normal, s.displacement_at(&o.centroid), None))
        .collect();

    let turn = |common: &Option<SmallMotion>| {
        common
            .as_ref()
            .map_or_else(Vector3::zeros, |c| c.motion.fixed_rows::<3>(3).into_owned())
    };
    let (estimated, truth) = MotionSample::common_motions(&samples);
    let (estimated, truth) = (turn(&estimated), turn(&truth));
    let absolute: Vec<RotationSample> = turned
        .iter()
        .map(|(_, s, r)| RotationSample::new(&s.normal, r.rotation, s.rotation, &r.covariance))
        .collect();
    let relative: Vec<RotationSample> = turned
        .iter()
        .map(|(_, s, r)| {
            let [own, true_own] = [r.rotation - estimated, s.rotation - truth];
            RotationSample::new(&s.normal, own, true_own, &r.covariance_without_datum)
        })
        .collect();

    let calibration = |samples: &[RotationSample]| {
        Calibration::of(&samples.iter().map(RotationSample::claim).collect::<Vec<_>>())
    };
    Some(RotationScore {
        estimated: turned.len(),
        errors: axes(&absolute),
        errors_without_datum: axes(&relative),
        calibration: turned
            .iter()
            .all(|(o, ..)| o.datum_known)
            .then(|| calibration(&absolute)),
        calibration_without_datum: calibration(&relative),
    })
}

fn axes(samples: &[RotationSample]) -> RotationAxes {
    let statistics = |pick: fn(&Vector3<f64>) -> f64| {
        let errors: Vec<f64> = samples.iter().map(|s| pick(&s.error)).collect();
        let truths: Vec<f64> = samples.iter().map(|s| pick(&s.truth)).collect();
        RotationStatistics::of(&errors, &truths)
    };
    RotationAxes {
        about_along: statistics(|v| v.x),
        about_up: statistics(|v| v.y),
        about_out: statistics(|v| v.z),
        angle: statistics(|v| v.norm()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::id::StoneId;
    use nalgebra::Point3;

    /// A stone of a wall that looks along x, so that along is y, up is z and out is x.
    fn stone(stone_id: u32, rotation: Vector3<f64>) -> TrueStone {
        let y = f64::from(stone_id);
        TrueStone {
            stone_id: StoneId(stone_id),
            centroid: Point3::new(0.0, y, (5.0 * y).sin()),
            normal: Vector3::x(),
            displacement: Vector3::zeros(),
            rotation,
            loose: false,
            edge: false,
            visible_share: 1.0,
        }
    }

    /// What is reported of it: this rotation, with a standard deviation of 1 mrad.
    fn row(stone: &TrueStone, rotation: Vector3<f64>, displacement: Vector3<f64>) -> StoneOutcome {
        let covariance = Matrix3::identity() * 1e-6;
        StoneOutcome {
            stone: stone.stone_id,
            centroid: stone.centroid,
            normal: stone.normal,
            displacement: Some(displacement),
            covariance: Some(covariance),
            covariance_without_datum: Some(covariance),
            rotation: Some(RotationEstimate {
                rotation,
                covariance,
                covariance_without_datum: covariance,
            }),
            datum_known: true,
            detection_limit_m: None,
            significant: None,
            loose: Some(false),
        }
    }

    fn score(rows: Vec<(StoneOutcome, TrueStone)>) -> RotationScore {
        let owned = |(outcome, stone): (StoneOutcome, TrueStone)| ((outcome, Some(stone.stone_id)), stone);
        let (outcomes, stones): (Vec<Owned>, Vec<_>) = rows.into_iter().map(owned).unzip();
        score_rotations(&outcomes, &stones, &EvaluationParams::default()).unwrap()
    }

    #[test]
    fn an_error_counts_about_its_axis() {
        let truth = Vector3::new(0.0, 0.03, 0.0);
        let rows: Vec<_> = [(1, 1e-3), (2, -3e-3)]
            .into_iter()
            .map(|(id, e)| {
                let stone = stone(id, truth);
                (
                    row(&stone, truth + Vector3::new(0.0, e, 0.0), Vector3::zeros()),
                    stone,
                )
            })
            .collect();
        let score = score(rows);
        // Errors of 1 and -3 mrad about y, one of which lies within 1.96 mrad.
        let along = score.errors.about_along.unwrap();
        assert!((along.rmse_mrad - 5f64.sqrt()).abs() < 1e-9 && (along.mean_mrad + 1.0).abs() < 1e-9);
        assert!((along.zero_predictor_rmse_mrad - 30.0).abs() < 1e-9);
        assert!(score.errors.about_up.unwrap().rmse_mrad < 1e-9);
        assert!(score.errors.about_out.unwrap().rmse_mrad < 1e-9);
        assert!((score.errors.angle.unwrap().p95_mrad - 2.9).abs() < 1e-9);
        let calibration = score.calibration.unwrap();
        assert_eq!(calibration.coverage_95.along, Some(0.5));
        assert_eq!(calibration.coverage_95.out, Some(1.0));
        assert!((calibration.chi_square_mean.unwrap() - 5.0).abs() < 1e-6);
    }

    #[test]
    fn the_error_is_the_rotation_between_two_orientations() {
        // A quarter turn about z, reported with a further 2 mrad about the turned stone's own x, which is the
        // world's y.
        let truth = Rotation3::from_scaled_axis(Vector3::z() * std::f64::consts::FRAC_PI_2);
        let reported = truth * Rotation3::from_scaled_axis(Vector3::x() * 2e-3);
        let stone = stone(1, truth.scaled_axis());
        let score = score(vec![(
            row(&stone, reported.scaled_axis(), Vector3::zeros()),
            stone,
        )]);
        assert!((score.errors.about_along.unwrap().mean_mrad - 2.0).abs() < 1e-9);
        assert!(score.errors.about_out.unwrap().rmse_mrad < 1e-9);
    }

    #[test]
    fn a_turn_of_the_whole_survey_is_no_error_without_a_datum() {
        let survey = Vector3::new(2e-3, -1e-3, 4e-3);
        let rows: Vec<_> = (0..12)
            .map(|i| {
                let stone = stone(i, Vector3::new(0.0, 0.0, 1e-4 * f64::from(i % 3)));
                let displacement = survey.cross(&stone.centroid.coords);
                (row(&stone, stone.rotation + survey, displacement), stone)
            })
            .collect();
        let score = score(rows);
        assert!((score.errors.angle.unwrap().median_mrad - survey.norm() * 1e3).abs() < 1e-2);
        assert!(score.errors_without_datum.angle.unwrap().p95_mrad < 1e-2);
        assert_eq!(score.calibration.unwrap().coverage_95.up, Some(0.0));
        assert_eq!(score.calibration_without_datum.coverage_95.up, Some(1.0));
    }
}
