//! One estimated motion beside the truth.

use super::calibration::Claim;
use crate::change::ChangePoint;
use crate::geometry::{DisplacementSample, FaceFrame, SmallMotion};
use crate::id::StoneId;
use crate::params::{Params, Range, Ranged, with_ranges};
use nalgebra::{Matrix3, Point3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the evaluation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct EvaluationParams {
    /// Larger absolute errors are outliers, metres.
    pub outlier_m: f64,
    /// What truly moves less counts as still when alarms are counted, metres.
    pub still_m: f64,
    /// Share of a simulated stone's face that both epochs must show for the stone to count.
    pub min_visible_share: f64,
    /// A true label or centroid further than this from a result's centroid does not own the result, metres.
    pub owner_reach_m: f64,
}

impl Default for EvaluationParams {
    fn default() -> Self {
        Self {
            // Twice the paper's RMSE on terrestrial scans.
            outlier_m: 0.01,
            // Below what any scanner of today resolves on a stone.
            still_m: 1e-4,
            // The rule that the simulated surveys are scored by.
            min_visible_share: 0.35,
            // The centroid of a stone's points lies behind its face by up to its relief, a few centimetres.
            owner_reach_m: 0.1,
        }
    }
}

impl Params for EvaluationParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::NOT_NEGATIVE.holds("outlier_m", self.outlier_m),
            Range::NOT_NEGATIVE.holds("still_m", self.still_m),
            Range::SHARE.holds("min_visible_share", self.min_visible_share),
            Range::NOT_NEGATIVE.holds("owner_reach_m", self.owner_reach_m),
        ]
    }
}

/// What a run says about one stone, as far as the evaluation needs it.
#[derive(Clone, Debug, PartialEq)]
pub struct StoneOutcome {
    /// Stone of the first epoch.
    pub stone: StoneId,
    /// Its centroid in the first epoch, world frame, metres.
    pub centroid: Point3<f64>,
    /// Outward normal of the wall's face around it.
    pub normal: Vector3<f64>,
    /// Displacement of the centroid, metres; `None` where there is no estimate, for whatever reason.
    pub displacement: Option<Vector3<f64>>,
    /// Covariance of the displacement, m^2, registration error included where it is known.
    pub covariance: Option<Matrix3<f64>>,
    /// Covariance of the displacement without the registration error of the epochs, m^2.
    pub covariance_without_datum: Option<Matrix3<f64>>,
    /// Its rotation; `None` where there is no estimate.
    pub rotation: Option<RotationEstimate>,
    /// Whether the registration error is known; else limits and alarms hold for motions against the common
    /// rigid motion of the stones that are not reported as loose.
    pub datum_known: bool,
    /// Smallest significant displacement at 95 %, metres.
    pub detection_limit_m: Option<f64>,
    /// Reported as moved, at 95 %.
    pub significant: Option<bool>,
    /// Reported as moving unlike its neighbours.
    pub loose: Option<bool>,
}

/// An estimated rotation of a stone.
#[derive(Clone, Debug, PartialEq)]
pub struct RotationEstimate {
    /// Rotation vector, world frame, radians.
    pub rotation: Vector3<f64>,
    /// Its covariance, rad^2, registration error included where it is known.
    pub covariance: Matrix3<f64>,
    /// Covariance of the rotation vector without the registration error of the epochs, world frame, rad^2.
    pub covariance_without_datum: Matrix3<f64>,
}

/// An estimated displacement with its truth and what was claimed about it.
#[derive(Clone, Debug)]
pub struct MotionSample {
    /// Along-dam, up and out-of-plane axes at the place.
    pub frame: FaceFrame,
    /// Estimated displacement, world frame, metres.
    pub estimated: Vector3<f64>,
    /// True displacement, world frame, metres.
    pub truth: Vector3<f64>,
    /// The place, world frame, metres.
    pub place: Point3<f64>,
    /// Covariance of the estimate, world frame, m^2.
    pub covariance: Option<Matrix3<f64>>,
    /// Covariance of the estimate without the registration error of the epochs, world frame, m^2.
    pub covariance_without_datum: Option<Matrix3<f64>>,
    /// Whether claims are about absolute motions, not about motions against the common one.
    pub is_absolute: bool,
    /// Whether the sample takes part in the common motion: it is not reported as loose.
    pub is_common: bool,
    /// Half-widths of the claimed 95 % intervals along, up and out, metres; `None` where nothing is claimed.
    pub half_width_m: [Option<f64>; 3],
    /// Smallest significant displacement at 95 %, metres.
    pub detection_limit_m: Option<f64>,
    /// Reported as moved, at 95 %.
    pub significant: Option<bool>,
    /// Reported as loose, and truly loose.
    pub loose: Option<(bool, bool)>,
}

/// Half-width of a 95 % interval of the normal distribution, in standard deviations.
pub(super) const Z95: f64 = 1.959_963_984_540_054;

impl MotionSample {
    /// A stone's motion beside the truth at its centroid; `None` where the stone has no estimate.
    ///
    /// 95 % intervals are 1.96 standard deviations of the covariance along each axis.
    pub fn of_stone(
        outcome: &StoneOutcome,
        normal: &Vector3<f64>,
        truth: Vector3<f64>,
        truly_loose: Option<bool>,
    ) -> Option<Self> {
        let frame = FaceFrame::from_normal(normal);
        let axes = [frame.along, frame.up, frame.out];
        Some(Self {
            frame,
            estimated: outcome.displacement?,
            truth,
            place: outcome.centroid,
            covariance: outcome.covariance,
            covariance_without_datum: outcome.covariance_without_datum,
            is_absolute: outcome.datum_known,
            is_common: outcome.loose != Some(true),
            half_width_m: half_widths(&axes, outcome.covariance.as_ref()),
            detection_limit_m: outcome.detection_limit_m,
            significant: outcome.significant,
            loose: outcome.loose.zip(truly_loose),
        })
    }

    /// An M3C2 distance beside the truth at its core point; `None` where M3C2 has no distance.
    ///
    /// The displacement is distance times normal; the detection limit is M3C2's claim out of the plane, and
    /// in the plane it claims nothing.
    pub fn of_change(point: &ChangePoint, normal: &Vector3<f64>, truth: Vector3<f64>) -> Option<Self> {
        Some(Self {
            frame: FaceFrame::from_normal(normal),
            estimated: point.displacement()?,
            truth,
            place: point.position,
            covariance: None,
            covariance_without_datum: None,
            is_absolute: true,
            is_common: true,
            half_width_m: [None, None, point.detection_limit_m],
            detection_limit_m: point.detection_limit_m,
            significant: point.detection_limit_m.map(|_| point.is_significant()),
            loose: None,
        })
    }

    /// The common rigid motions of estimates and of truths: least squares over the samples that are not
    /// reported as loose, weighted by the inverse covariances that hold without a datum.
    pub(super) fn common_motions(samples: &[Self]) -> (Option<SmallMotion>, Option<SmallMotion>) {
        let common = |of: fn(&Self) -> Vector3<f64>| {
            let fitted: Vec<DisplacementSample> = samples
                .iter()
                .filter(|s| s.is_common)
                .filter_map(|s| {
                    Some(DisplacementSample {
                        place: s.place,
                        displacement: of(s),
                        covariance: s.covariance_without_datum?,
                    })
                })
                .collect();
            SmallMotion::fit(&fitted)
        };
        (common(|s| s.estimated), common(|s| s.truth))
    }

    /// The samples less the common rigid motion of estimates and of truths, with the claims that hold without a datum;
    /// samples without such a claim are left out.
    pub(super) fn without_datum(samples: &[Self]) -> Vec<Self> {
        let (estimated, truth) = Self::common_motions(samples);
        let at = |fitted: &Option<SmallMotion>, p: &Point3<f64>| {
            fitted.as_ref().map_or_else(Vector3::zeros, |f| f.at(p))
        };
        let relative = |s: &Self| Self {
            estimated: s.estimated - at(&estimated, &s.place),
            truth: s.truth - at(&truth, &s.place),
            covariance: s.covariance_without_datum,
            half_width_m: half_widths(
                &[s.frame.along, s.frame.up, s.frame.out],
                s.covariance_without_datum.as_ref(),
            ),
            ..s.clone()
        };
        samples
            .iter()
            .filter(|s| s.covariance_without_datum.is_some())
            .map(relative)
            .collect()
    }

    /// The errors along, up and out with what was claimed about them.
    pub(super) fn claims(samples: &[Self]) -> Vec<Claim> {
        let claim = |s: &Self| Claim {
            error: s.error(),
            half_width: s.half_width_m,
            normalised: normalised(&(s.estimated - s.truth), s.covariance.as_ref()),
        };
        samples.iter().map(claim).collect()
    }

    /// Estimate minus truth in (along, up, out), metres.
    pub fn error(&self) -> Vector3<f64> {
        self.frame.face_from_world() * (self.estimated - self.truth)
    }

    /// Truth in (along, up, out), metres.
    pub fn local_truth(&self) -> Vector3<f64> {
        self.frame.face_from_world() * self.truth
    }
}

/// Squared Mahalanobis length of an error; `None` without a positive definite covariance.
pub(super) fn normalised(error: &Vector3<f64>, covariance: Option<&Matrix3<f64>>) -> Option<f64> {
    let solved = covariance?.cholesky()?.solve(error);
    Some(error.dot(&solved)).filter(|x| x.is_finite())
}

/// Half-widths of the 95 % intervals along these axes.
pub(super) fn half_widths(axes: &[Vector3<f64>; 3], covariance: Option<&Matrix3<f64>>) -> [Option<f64>; 3] {
    axes.map(|axis| covariance.map(|c| Z95 * axis.dot(&(c * axis)).max(0.0).sqrt()))
}
