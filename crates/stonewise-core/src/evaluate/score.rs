//! Scores of many motions against their truth.

use crate::change::{ChangeField, ChangePoint};
use crate::evaluate::{
    Calibration, Detection, ErrorStatistics, EvaluationParams, LooseDetection, MotionSample, StoneOutcome,
};
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

/// How right a set of motions is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionScore {
    /// Stones or core points that should have an estimate.
    pub expected: usize,
    /// Those that have one; all figures are about them.
    pub estimated: usize,
    /// Errors per direction.
    pub errors: Directions,
    /// Errors per direction, with the common rigid motions of estimates and of truths taken off.
    #[serde(default)]
    pub errors_without_datum: Directions,
    /// Share of estimates whose 3D error is beyond the outlier limit.
    pub outlier_rate: Option<f64>,
    /// Whether the claimed uncertainties are right; `None` where the datum is unknown, so that absolute motions have
    /// no claim.
    pub calibration: Option<Calibration>,
    /// Whether claims against the common rigid motion are right, registration error left out; `None` where none is
    /// made
    /// about it.
    #[serde(default)]
    pub calibration_without_datum: Option<Calibration>,
    /// Alarms against truth; where no datum is known, of motions against the common rigid motion.
    pub significance: Detection,
    /// Loose stones against truth.
    pub loose: Option<LooseDetection>,
}

/// Statistics per direction of the dam frame; `None` without estimates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Directions {
    /// Along the dam, signed.
    pub along: Option<ErrorStatistics>,
    /// Up the face, signed.
    pub up: Option<ErrorStatistics>,
    /// Along and up components pooled, signed: twice as many errors as estimates.
    pub in_plane_per_axis: Option<ErrorStatistics>,
    /// Norm of (along, up).
    pub in_plane_2d: Option<ErrorStatistics>,
    /// Out of the face, signed, positive downstream.
    pub out_of_plane: Option<ErrorStatistics>,
    /// Norm of all three.
    pub norm_3d: Option<ErrorStatistics>,
}

/// Scores samples; `expected` is how many there would be without failures.
pub fn score_motions(samples: &[MotionSample], expected: usize, params: &EvaluationParams) -> MotionScore {
    let errors = directions(samples, params.outlier_m);
    let relative = MotionSample::without_datum(samples);
    let is_absolute = samples.iter().all(|s| s.is_absolute);
    let tested = if is_absolute { samples } else { &relative };
    MotionScore {
        expected,
        estimated: samples.len(),
        outlier_rate: errors.norm_3d.as_ref().map(|s| s.outlier_rate),
        errors,
        errors_without_datum: directions(&relative, params.outlier_m),
        calibration: is_absolute.then(|| Calibration::of(&MotionSample::claims(samples))),
        calibration_without_datum: (!relative.is_empty())
            .then(|| Calibration::of(&MotionSample::claims(&relative))),
        significance: Detection::of(tested, params.still_m),
        loose: LooseDetection::of(samples),
    }
}

/// Scores stones against a known displacement, taken at each stone's epoch-1 centroid.
///
/// For a bulge the truth is the field at the centroid, not its mean over the stone.
pub fn score_stones(
    outcomes: &[StoneOutcome],
    truth: impl Fn(&Point3<f64>) -> Vector3<f64>,
    params: &EvaluationParams,
) -> MotionScore {
    let samples: Vec<_> = outcomes
        .iter()
        .filter_map(|o| MotionSample::of_stone(o, &o.normal, truth(&o.centroid), None))
        .collect();
    score_motions(&samples, outcomes.len(), params)
}

/// Scores M3C2 against a known displacement, taken at each core point.
///
/// M3C2's displacement vector is distance times normal. `face_normal` gives the wall's outward normal at a
/// core point, which sets the directions that errors are counted in: the wall's own at the scale of stones
/// and more, for out-of-plane to mean the same as for stones. The detection limit is M3C2's claim along its
/// normal.
pub fn score_change(
    field: &ChangeField,
    truth: impl Fn(&Point3<f64>) -> Vector3<f64>,
    face_normal: impl Fn(&ChangePoint) -> Vector3<f64>,
    params: &EvaluationParams,
) -> MotionScore {
    let samples: Vec<_> = field
        .points
        .iter()
        .filter_map(|p| MotionSample::of_change(p, &face_normal(p), truth(&p.position)))
        .collect();
    score_motions(&samples, field.points.len(), params)
}

pub(super) fn directions(samples: &[MotionSample], outlier_m: f64) -> Directions {
    let errors: Vec<Vector3<f64>> = samples.iter().map(MotionSample::error).collect();
    let truths: Vec<Vector3<f64>> = samples.iter().map(MotionSample::local_truth).collect();
    let statistics = |pick: &dyn Fn(&Vector3<f64>) -> Vec<f64>| {
        let [e, t] = [&errors, &truths].map(|v| v.iter().flat_map(pick).collect::<Vec<_>>());
        ErrorStatistics::of(&e, &t, outlier_m)
    };
    Directions {
        along: statistics(&|v| vec![v.x]),
        up: statistics(&|v| vec![v.y]),
        in_plane_per_axis: statistics(&|v| vec![v.x, v.y]),
        in_plane_2d: statistics(&|v| vec![v.x.hypot(v.y)]),
        out_of_plane: statistics(&|v| vec![v.z]),
        norm_3d: statistics(&|v| vec![v.norm()]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::id::StoneId;
    use nalgebra::Matrix3;

    /// A wall that looks along x: along is y, up is z.
    fn outcome(displacement: Option<Vector3<f64>>) -> StoneOutcome {
        StoneOutcome {
            stone: StoneId(1),
            centroid: Point3::origin(),
            normal: Vector3::x(),
            displacement,
            covariance: None,
            covariance_without_datum: None,
            rotation: None,
            datum_known: true,
            detection_limit_m: Some(0.004),
            significant: Some(displacement.is_some_and(|d| d.norm() > 0.004)),
            loose: None,
        }
    }

    #[test]
    fn an_estimate_of_zero_scores_as_the_zero_predictor() {
        let outcomes = vec![outcome(Some(Vector3::zeros())); 7];
        let truth = Vector3::new(0.0, 0.02, 0.05);
        let score = score_stones(&outcomes, |_| truth, &EvaluationParams::default());
        let per_axis = score.errors.in_plane_per_axis.unwrap();
        // The figure to beat for the paper's shift: sqrt((2^2 + 5^2) / 2) = 3.8 cm.
        assert!((per_axis.rmse_m - 0.03808).abs() < 1e-5);
        assert_eq!(per_axis.rmse_m, per_axis.zero_predictor_rmse_m);
        assert_eq!(per_axis.count, 14);
        assert!((score.errors.in_plane_2d.unwrap().rmse_m - 0.0029f64.sqrt()).abs() < 1e-12);
        assert_eq!(score.errors.out_of_plane.unwrap().rmse_m, 0.0);
        assert_eq!((score.significance.moved, score.significance.hits), (7, 0));
        assert_eq!(score.significance.detectable_hit_rate, Some(0.0));
        assert_eq!(score.outlier_rate, Some(1.0));
    }

    #[test]
    fn errors_go_to_their_direction_and_failures_are_counted() {
        let outcomes = [outcome(Some(Vector3::new(0.003, 0.004, 0.012))), outcome(None)];
        let score = score_stones(&outcomes, |_| Vector3::zeros(), &EvaluationParams::default());
        assert_eq!((score.expected, score.estimated), (2, 1));
        let e = score.errors;
        assert!((e.out_of_plane.unwrap().mean_m - 0.003).abs() < 1e-15);
        assert!((e.along.unwrap().mean_m - 0.004).abs() < 1e-15);
        assert!((e.up.unwrap().mean_m - 0.012).abs() < 1e-15);
        assert!((e.norm_3d.unwrap().rmse_m - 0.013).abs() < 1e-15);
        assert_eq!(
            (score.significance.still, score.significance.false_alarms),
            (1, 1)
        );
    }

    #[test]
    fn without_a_datum_a_common_motion_is_neither_error_nor_alarm() {
        let moved = |i: u32, error: f64| {
            let place = Point3::new(0.0, f64::from(i % 4), f64::from(i / 4));
            let common = Vector3::new(0.001 * place.y, 0.02, 0.05);
            let own = Vector3::new(error, 0.0, 0.0);
            let covariance = Matrix3::identity() * 1e-6;
            StoneOutcome {
                centroid: place,
                covariance: Some(covariance),
                covariance_without_datum: Some(covariance),
                datum_known: false,
                significant: Some(error > 0.003),
                ..outcome(Some(common + own))
            }
        };
        let mut outcomes: Vec<StoneOutcome> = (0..16).map(|i| moved(i, 0.0)).collect();
        outcomes.push(StoneOutcome {
            loose: Some(true),
            ..moved(17, 0.004)
        });
        // The estimates tilt by a millimetre per metre and shift; the wall truly stood still.
        let score = score_stones(&outcomes, |_| Vector3::zeros(), &EvaluationParams::default());
        assert!(score.calibration.is_none());
        let left = score.errors_without_datum;
        assert!(left.up.unwrap().rmse_m < 1e-12 && left.along.unwrap().rmse_m < 1e-12);
        assert!((left.out_of_plane.unwrap().p95_m - 0.004 * 0.2).abs() < 1e-12);
        let calibration = score.calibration_without_datum.unwrap();
        assert_eq!(calibration.coverage_95.along, Some(1.0));
        assert_eq!(calibration.coverage_95.out, Some(16.0 / 17.0));
        assert_eq!(
            (score.significance.still, score.significance.false_alarms),
            (17, 1)
        );
    }

    #[test]
    fn m3c2_is_blind_in_the_plane_and_claims_nothing_there() {
        let point = ChangePoint {
            position: Point3::origin(),
            normal: Vector3::x(),
            distance_m: Some(0.011),
            detection_limit_m: Some(0.002),
            spread_m: [Some(0.001); 2],
            counts: [30; 2],
        };
        let empty = ChangePoint {
            distance_m: None,
            ..point
        };
        let field = ChangeField {
            points: vec![point, empty],
        };
        let truth = Vector3::new(0.01, 0.02, 0.05);
        let score = score_change(&field, |_| truth, |p| p.normal, &EvaluationParams::default());
        assert_eq!((score.expected, score.estimated), (2, 1));
        assert!((score.errors.out_of_plane.unwrap().rmse_m - 0.001).abs() < 1e-15);
        assert!((score.errors.up.unwrap().rmse_m - 0.05).abs() < 1e-15);
        let coverage = score.calibration.unwrap().coverage_95;
        assert_eq!(
            (coverage.along, coverage.up, coverage.out),
            (None, None, Some(1.0))
        );
        assert_eq!(score.significance.hit_rate, Some(1.0));
    }
}
