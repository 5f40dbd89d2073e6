//! One row of the stone table.

use crate::budget::{Budget, Term};
use nalgebra::{Matrix3, Point2, Point3, Vector3};
use std::fmt;
use std::str::FromStr;
use stonewise_core::geometry::{FaceFrame, SmallMotion};
use stonewise_core::registration::StoneDeformation;
use stonewise_core::stone::{
    MatchOutcome, MotionFailure, PairResult, SharedParts, Stone, StoneMotion, UnmatchedReason,
};

/// 95 % quantile of chi-square with 3 degrees of freedom.
const CHI2_3_95: f64 = 7.814_727_903_251_179;

/// One epoch-1 stone with all that is known about its motion. Units as in the columns: metres, radians.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StoneRow {
    /// Stone of epoch 1.
    pub stone_id: u32,
    /// Centroid in epoch 1, world.
    pub centroid: Point3<f64>,
    /// Place along the unrolled wall.
    pub along_m: f64,
    /// Place up the unrolled wall.
    pub up_m: f64,
    /// Area of the visible face in epoch 1.
    pub area_m2: f64,
    /// Points in epoch 1.
    pub points_1: u32,
    /// Points in the later epoch; `None` where the stone has no partner.
    pub points_2: Option<u32>,
    /// Photos of epoch 1 that show the stone.
    pub photos: u32,
    /// Mean share of the votes, 0 to 1.
    pub confidence: f64,
    /// Partner in the later epoch.
    pub matched_id: Option<u32>,
    /// The part of the wall that ties join, 1 the largest; `None` where no motion was sought.
    pub body_id: Option<u32>,
    /// What became of the stone.
    pub status: Status,
    /// Zone of deformation, 0 for none.
    pub zone_id: u32,
    /// The motion, where there is one.
    pub motion: Option<RowMotion>,
    /// The last edit by hand that made or changed the stone or its partner: its number in the file of edits.
    pub edited: Option<u32>,
    /// Number of the epoch whose photos show the stone, where it was carried into the other one.
    pub carried_from: Option<u32>,
}

/// The measured motion of a stone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RowMotion {
    /// Displacement of the centroid, world.
    pub displacement: Vector3<f64>,
    /// The displacement as (along-dam, up, out-of-plane) of the stone's own face frame.
    pub face: Vector3<f64>,
    /// Rotation vector, world.
    pub rotation: Vector3<f64>,
    /// Covariance of what is tested: of `displacement`, registration error of the epochs included; where that
    /// error is not known, of the motion against the common rigid motion of the measured stones.
    pub covariance: Matrix3<f64>,
    /// Standard deviations of `face`.
    pub face_sd: Vector3<f64>,
    /// Covariance of `rotation`.
    pub rotation_covariance: Matrix3<f64>,
    /// Displacement against the neighbours, world.
    pub relative: Vector3<f64>,
    /// Covariance of `relative`.
    pub relative_covariance: Matrix3<f64>,
    /// 95 % detection limit along the direction of the tested motion, see [`detection_limit_m`].
    pub detection_limit_m: f64,
    /// Differs from zero at 95 %: exactly where the tested motion is longer than `detection_limit_m`.
    pub significant: bool,
    /// Moves unlike its neighbours, significantly.
    pub loose: bool,
    /// Probability that the stone is loose, where the estimator gives one.
    pub p_loose: Option<f64>,
    /// Displacement less the rigid motion of the part of the wall that kept its shape, world; empty where the stone's
    /// part of the wall is too small to tell.
    pub deformation: [Option<f64>; 3],
    /// Standard deviations of that along the wall, up and out.
    pub deformation_sd: [Option<f64>; 3],
    /// Smallest observability, 0 to 1.
    pub observability: f64,
    /// Where `face_sd` comes from.
    pub budget: Budget,
}

/// The registration error subtracted from a stone's motion, and the reference motion that the result is
/// tested against.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reference {
    /// Estimated error of the later epoch at the stone, metres, world: taken off the displacement.
    pub error: Vector3<f64>,
    /// Rotation vector of that error, radians, world: taken off the rotation.
    pub turn: Vector3<f64>,
    /// Motion of the reference at the stone, metres, world: zero where the registration of the epochs is
    /// known, else the common rigid motion of the measured stones.
    pub motion: Vector3<f64>,
    /// Covariances that the reference adds to the stone's own, world, m^2.
    pub terms: Vec<(Term, Matrix3<f64>)>,
    /// Covariance that the reference adds to the rotation of the stone, rad^2.
    pub rotation_covariance: Matrix3<f64>,
}

impl Reference {
    /// Covariance that the reference adds to the stone's own, world, m^2.
    fn covariance(&self) -> Matrix3<f64> {
        self.terms.iter().map(|(_, covariance)| covariance).sum()
    }

    /// The common motion at a stone with the error of its estimate: what a stone is tested against where
    /// nothing is known about the registration. `relative`: covariances of the non-rigid part of the
    /// registration error at the stone, m^2.
    pub fn against(common: Option<&SmallMotion>, stone: &Stone, relative: Vec<(Term, Matrix3<f64>)>) -> Self {
        common.map_or_else(Self::default, |common| Self {
            motion: common.at(&stone.centroid),
            terms: [
                vec![(Term::CommonMotion, common.covariance_at(&stone.centroid))],
                relative,
            ]
            .concat(),
            rotation_covariance: common.covariance.fixed_view::<3, 3>(3, 3).into_owned(),
            ..Self::default()
        })
    }
}

/// The word in column `status`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Status {
    /// Measured.
    #[default]
    Ok,
    /// The later epoch does not see the place.
    UnmatchedUnseen,
    /// The later epoch sees the place, but no stone was found there.
    UnmatchedLost,
    /// Candidates too alike.
    UnmatchedAmbiguous,
    /// The candidate's face has another size.
    UnmatchedArea,
    /// No stone of the wall.
    NotMasonry,
    /// Too few points.
    FailedPoints,
    /// The estimate did not settle.
    FailedConvergence,
    /// The two epochs show different surfaces.
    FailedDisagreement,
    /// The surface does not show the motion.
    Unobservable,
}

impl Status {
    /// Every status, in the order of reports.
    pub const ALL: [Self; 10] = [
        Self::Ok,
        Self::UnmatchedUnseen,
        Self::UnmatchedLost,
        Self::UnmatchedAmbiguous,
        Self::UnmatchedArea,
        Self::NotMasonry,
        Self::FailedPoints,
        Self::FailedConvergence,
        Self::FailedDisagreement,
        Self::Unobservable,
    ];

    /// The word in the table.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::UnmatchedUnseen => "unmatched_unseen",
            Self::UnmatchedLost => "unmatched_lost",
            Self::UnmatchedAmbiguous => "unmatched_ambiguous",
            Self::UnmatchedArea => "unmatched_area",
            Self::NotMasonry => "not_masonry",
            Self::FailedPoints => "failed_points",
            Self::FailedConvergence => "failed_convergence",
            Self::FailedDisagreement => "failed_disagreement",
            Self::Unobservable => "unobservable",
        }
    }

    /// What it means, for readers of the report.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Ok => "measured",
            Self::UnmatchedUnseen => "the later epoch has no points, or no photo of them, at this place",
            Self::UnmatchedLost => "the later epoch shows the place, but no stone was found there",
            Self::UnmatchedAmbiguous => "several stones of the later epoch fit equally well",
            Self::UnmatchedArea => {
                "the best candidate's face is much larger or smaller: masks merged or split"
            }
            Self::NotMasonry => {
                "no stone of the wall: fields of one relief that stand back from it, as of a door or a shutter"
            }
            Self::FailedPoints => "too few points for an estimate",
            Self::FailedConvergence => "the estimate did not settle",
            Self::FailedDisagreement => {
                "the two epochs do not show the same surface, or nothing confirms a motion unlike the rest of the wall"
            }
            Self::Unobservable => "the surface is too flat to show the motion",
        }
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl FromStr for Status {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|s| s.word() == word);
        found.ok_or_else(|| format!("{word:?} is no status of a stone"))
    }
}

impl StoneRow {
    /// The row of a stone, from what matching and registration say about it.
    ///
    /// `second`: its partner in the later epoch, where it has one. `pair`: the motion, where one was sought.
    /// `reference`: what the motion is tested against.
    /// `place`: where the stone lies on the unrolled wall, (along, up).
    /// A stone that is matched but was not handed to the registration has status `failed_points`.
    pub fn new(
        first: &Stone,
        outcome: &MatchOutcome,
        second: Option<&Stone>,
        pair: Option<&PairResult>,
        reference: &Reference,
        place: &Point2<f64>,
    ) -> Self {
        let motion = pair.and_then(|p| p.motion.as_ref().ok());
        let matched_id = match outcome {
            MatchOutcome::Matched { second } => Some(second.0),
            MatchOutcome::Unmatched(_) => None,
        };
        Self {
            stone_id: first.id.0,
            centroid: first.centroid,
            along_m: place.x,
            up_m: place.y,
            area_m2: first.area_m2,
            points_1: first.points,
            points_2: second.map(|s| s.points),
            photos: first.photos,
            confidence: first.confidence,
            matched_id,
            body_id: pair.map(|p| p.body).filter(|body| *body > 0),
            status: status(outcome, pair),
            zone_id: 0,
            motion: motion.map(|m| RowMotion::new(m, &first.normal, reference)),
            edited: None,
            carried_from: None,
        }
    }
}

impl StoneRow {
    /// The row with its deformation.
    #[must_use]
    pub fn with_deformation(mut self, normal: &Vector3<f64>, deformation: &StoneDeformation) -> Self {
        self.zone_id = deformation.zone;
        if let Some(motion) = &mut self.motion {
            let face_from_world = FaceFrame::from_normal(normal).face_from_world();
            let in_face = face_from_world * deformation.covariance * face_from_world.transpose();
            motion.deformation = <[f64; 3]>::from(deformation.deformation).map(Some);
            motion.deformation_sd = [0, 1, 2].map(|k| Some(in_face[(k, k)].max(0.0).sqrt()));
        }
        self
    }
}

impl RowMotion {
    /// The deformation, world, metres.
    pub fn deformation(&self) -> Option<Vector3<f64>> {
        let [x, y, z] = self.deformation;
        Some(Vector3::new(x?, y?, z?))
    }

    /// Fills the lower triangles of the covariances, which files leave out.
    pub(super) fn mirror(&mut self) {
        for matrix in [
            &mut self.covariance,
            &mut self.rotation_covariance,
            &mut self.relative_covariance,
        ] {
            *matrix = symmetric(matrix);
        }
    }

    fn new(motion: &StoneMotion, normal: &Vector3<f64>, reference: &Reference) -> Self {
        let covariance = motion.covariance.fixed_view::<3, 3>(0, 0).into_owned();
        let SharedParts { points, poses } = motion.shared;
        let terms = [
            (Term::Stone, covariance - points - poses),
            (Term::Points, points),
            (Term::Poses, poses),
        ];
        let measured = Self {
            displacement: motion.displacement,
            rotation: motion.rotation,
            covariance,
            budget: Budget::of(normal, &terms),
            rotation_covariance: motion.covariance.fixed_view::<3, 3>(3, 3).into_owned(),
            relative: motion.relative,
            relative_covariance: symmetric(&motion.relative_covariance),
            loose: motion.loose,
            p_loose: motion.p_loose,
            observability: motion.observability,
            ..Self::default()
        };
        measured.against(normal, reference)
    }

    /// The motion with the error of a reference taken off, whose covariance is added.
    #[must_use]
    pub fn against(&self, normal: &Vector3<f64>, reference: &Reference) -> Self {
        let covariance = self.covariance + reference.covariance();
        let displacement = self.displacement - reference.error;
        let tested = displacement - reference.motion;
        let detection_limit_m = detection_limit_m(&tested, &covariance);
        let face_from_world = FaceFrame::from_normal(normal).face_from_world();
        let in_face = face_from_world * covariance * face_from_world.transpose();
        Self {
            displacement,
            face: face_from_world * displacement,
            rotation: self.rotation - reference.turn,
            covariance: symmetric(&covariance),
            face_sd: in_face.diagonal().map(|v| v.max(0.0).sqrt()),
            rotation_covariance: symmetric(&(self.rotation_covariance + reference.rotation_covariance)),
            detection_limit_m,
            significant: tested.norm() > detection_limit_m,
            budget: self.budget.with(&Budget::of(normal, &reference.terms)),
            ..self.clone()
        }
    }
}

/// The matrix with its upper triangle on both sides, as files hold it.
fn symmetric(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    let mut both = *matrix;
    both.fill_lower_triangle_with_upper_triangle();
    both
}

/// Length that a displacement of this direction must exceed to differ from zero at 95 %, metres.
///
/// The test is d' C^-1 d > 7.81, the 95 % quantile of chi-square with 3 degrees of freedom: a stone that
/// stands still is called significant in 5 % of the cases. Along the unit vector e of d it reads
/// |d| > sqrt(7.81 / (e' C^-1 e)), which is what this returns. A zero displacement has no direction; the largest limit
/// over all directions is given then. Infinite where C is not positive definite.
pub fn detection_limit_m(displacement: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
    let Some(cholesky) = covariance.cholesky() else {
        return f64::INFINITY;
    };
    match displacement.try_normalize(0.0) {
        Some(e) => (CHI2_3_95 / e.dot(&cholesky.solve(&e))).sqrt(),
        None => (CHI2_3_95 * covariance.symmetric_eigenvalues().max()).sqrt(),
    }
}

fn status(outcome: &MatchOutcome, pair: Option<&PairResult>) -> Status {
    match outcome {
        MatchOutcome::Unmatched(reason) => match reason {
            UnmatchedReason::Unseen => Status::UnmatchedUnseen,
            UnmatchedReason::Lost => Status::UnmatchedLost,
            UnmatchedReason::Ambiguous => Status::UnmatchedAmbiguous,
            UnmatchedReason::AreaMismatch => Status::UnmatchedArea,
            UnmatchedReason::NotMasonry => Status::NotMasonry,
        },
        MatchOutcome::Matched { .. } => match pair.map(|p| &p.motion) {
            Some(Ok(_)) => Status::Ok,
            None | Some(Err(MotionFailure::TooFewPoints { .. })) => Status::FailedPoints,
            Some(Err(MotionFailure::Unobservable { .. })) => Status::Unobservable,
            Some(Err(MotionFailure::NotConverged)) => Status::FailedConvergence,
            Some(Err(MotionFailure::Disagreement)) => Status::FailedDisagreement,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix6;
    use stonewise_core::geometry::Rigid3;
    use stonewise_core::id::StoneId;

    fn stone() -> Stone {
        Stone {
            id: StoneId(7),
            centroid: Point3::new(1.0, 2.0, 3.0),
            normal: Vector3::x(),
            area_m2: 0.06,
            points: 900,
            photos: 4,
            confidence: 0.9,
        }
    }

    fn pair(displacement: Vector3<f64>, sigma: f64) -> PairResult {
        let motion = StoneMotion {
            second_from_first: Rigid3::translation(displacement.x, displacement.y, displacement.z),
            displacement,
            rotation: Vector3::zeros(),
            covariance: Matrix6::identity() * (sigma * sigma),
            shared: SharedParts {
                points: Matrix3::from_diagonal(&Vector3::new(1e-6, 2e-6, 3e-6)),
                poses: Matrix3::identity() * 5e-7,
            },
            relative: Vector3::zeros(),
            relative_covariance: Matrix3::identity(),
            loose: false,
            p_loose: Some(0.01),
            observability: 0.8,
            rmse_m: 0.001,
        };
        PairResult {
            body: 1,
            first: StoneId(7),
            second: StoneId(9),
            motion: Ok(motion),
        }
    }

    #[test]
    fn a_measured_stone_has_dam_components_and_the_registration_error() {
        let pair = pair(Vector3::new(0.03, 0.01, -0.02), 0.003);
        let outcome = MatchOutcome::Matched { second: StoneId(9) };
        let reference = Reference {
            terms: vec![(Term::Registration, Matrix3::identity() * (0.004 * 0.004))],
            ..Reference::default()
        };
        let place = Point2::new(3.0, 1.5);
        let row = StoneRow::new(
            &stone(),
            &outcome,
            Some(&stone()),
            Some(&pair),
            &reference,
            &place,
        );
        assert_eq!((row.along_m, row.up_m), (3.0, 1.5));
        let motion = row.motion.unwrap();
        assert_eq!(
            (row.status, row.matched_id, row.points_2),
            (Status::Ok, Some(9), Some(900))
        );
        // The face looks along x: along-dam is y, up is z, out is x.
        assert!((motion.face - Vector3::new(0.01, -0.02, 0.03)).norm() < 1e-12);
        assert!((motion.covariance - Matrix3::identity() * (0.005 * 0.005)).norm() < 1e-12);
        assert!((motion.face_sd - Vector3::repeat(0.005)).norm() < 1e-12);
        // Along, up and out are y, z and x.
        let variances = |term| motion.budget.variances(term);
        assert!((variances(Term::Points) - Vector3::new(2e-6, 3e-6, 1e-6)).norm() < 1e-18);
        assert!((variances(Term::Registration) - Vector3::repeat(16e-6)).norm() < 1e-18);
        assert!((motion.budget.total() - motion.face_sd.map(|sd| sd * sd)).norm() < 1e-18);
        // Equal in all directions: sqrt(7.8147) sigma.
        assert!((motion.detection_limit_m - 0.005 * 2.795_483).abs() < 1e-8);
        assert!(motion.significant);
    }

    #[test]
    fn the_error_of_the_epoch_is_taken_off_and_its_uncertainty_added() {
        let error = Vector3::new(0.002, -0.001, 0.0005);
        let turn = Vector3::new(3e-4, -2e-4, 1e-4);
        let moved = pair(Vector3::new(0.03, 0.01, -0.02), 0.003);
        let reference = Reference {
            error,
            turn,
            terms: vec![(Term::Registration, Matrix3::identity() * 16e-6)],
            rotation_covariance: Matrix3::from_diagonal(&Vector3::new(1e-8, 4e-8, 9e-8)),
            ..Reference::default()
        };
        let outcome = MatchOutcome::Matched { second: StoneId(9) };
        let row = StoneRow::new(
            &stone(),
            &outcome,
            None,
            Some(&moved),
            &reference,
            &Point2::origin(),
        );
        let motion = row.motion.unwrap();
        assert!((motion.displacement - Vector3::new(0.028, 0.011, -0.0205)).norm() < 1e-15);
        assert!((motion.face - Vector3::new(0.011, -0.0205, 0.028)).norm() < 1e-12);
        assert_eq!(motion.rotation, -turn);
        let alone = 0.003 * 0.003;
        let variances = Vector3::new(alone + 1e-8, alone + 4e-8, alone + 9e-8);
        assert!((motion.rotation_covariance - Matrix3::from_diagonal(&variances)).norm() < 1e-18);
    }

    #[test]
    fn a_motion_that_the_reference_shares_is_not_significant() {
        let moved = Vector3::new(0.03, 0.01, -0.02);
        let outcome = MatchOutcome::Matched { second: StoneId(9) };
        let reference = Reference {
            motion: moved,
            ..Reference::default()
        };
        let pair = pair(moved, 0.003);
        let row = StoneRow::new(
            &stone(),
            &outcome,
            None,
            Some(&pair),
            &reference,
            &Point2::origin(),
        );
        let motion = row.motion.unwrap();
        assert!(!motion.significant);
        assert_eq!(motion.displacement, moved);
    }

    #[test]
    fn the_limit_is_that_of_the_direction_and_agrees_with_the_test() {
        let covariance = Matrix3::from_diagonal(&Vector3::new(1e-6, 1e-6, 1e-4));
        let limit = |d: Vector3<f64>| detection_limit_m(&d, &covariance);
        assert!((limit(Vector3::x()) - 1e-3 * 2.795_483).abs() < 1e-8);
        assert!((limit(Vector3::z()) - 1e-2 * 2.795_483).abs() < 1e-8);
        assert!((limit(Vector3::zeros()) - 1e-2 * 2.795_483).abs() < 1e-8);
        for scale in [0.5, 1.5] {
            let d = Vector3::new(0.3, -0.2, 0.9).normalize() * limit(Vector3::new(0.3, -0.2, 0.9)) * scale;
            let chi2 = d.dot(&(covariance.try_inverse().unwrap() * d));
            assert_eq!(chi2 > CHI2_3_95, scale > 1.0);
        }
        assert!(detection_limit_m(&Vector3::x(), &Matrix3::zeros()).is_infinite());
        assert!(detection_limit_m(&Vector3::x(), &(Matrix3::identity() * f64::NAN)).is_infinite());
    }

    #[test]
    fn every_failure_has_its_word() {
        let matched = MatchOutcome::Matched { second: StoneId(9) };
        let failed = |failure| PairResult {
            body: 1,
            first: StoneId(7),
            second: StoneId(9),
            motion: Err(failure),
        };
        let word = |outcome: &MatchOutcome, pair: Option<PairResult>| {
            let row = StoneRow::new(
                &stone(),
                outcome,
                None,
                pair.as_ref(),
                &Reference::default(),
                &Point2::origin(),
            );
            assert!(row.motion.is_none());
            row.status.to_string()
        };
        assert_eq!(
            word(&MatchOutcome::Unmatched(UnmatchedReason::AreaMismatch), None),
            "unmatched_area"
        );
        assert_eq!(
            word(&matched, Some(failed(MotionFailure::NotConverged))),
            "failed_convergence"
        );
        assert_eq!(
            word(&matched, Some(failed(MotionFailure::Disagreement))),
            "failed_disagreement"
        );
        let flat = MotionFailure::Unobservable {
            direction: Vector3::y(),
        };
        assert_eq!(word(&matched, Some(failed(flat))), "unobservable");
        for status in Status::ALL {
            assert_eq!(status.word().parse(), Ok(status));
        }
        assert!("<script>".parse::<Status>().is_err());
    }
}
