//! What is known of a stone within one epoch, and of its motion between two.

use crate::geometry::{DisplacementSample, Rigid3, SmallMotion};
use crate::id::StoneId;
use nalgebra::{Matrix3, Matrix6, Point3, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A stone of one epoch, as the labelled points show it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stone {
    /// Unique within the epoch; ascending in every list of stones.
    pub id: StoneId,
    /// Mean of the stone's points, world frame.
    pub centroid: Point3<f64>,
    /// Unit normal of the wall's face around the stone, pointing out of the wall (at the cameras).
    pub normal: Vector3<f64>,
    /// Area of the stone's visible face, m^2.
    pub area_m2: f64,
    /// Number of points.
    pub points: u32,
    /// Number of photos that show the stone.
    pub photos: u32,
    /// Mean share of the votes that the stone's points gave it, 0..1.
    pub confidence: f64,
}

/// What became of an epoch-1 stone when its partner in epoch 2 was sought.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum MatchOutcome {
    /// Found, with the quality of the match.
    Matched {
        /// The stone of the second epoch.
        second: StoneId,
    },
    /// Not found.
    Unmatched(UnmatchedReason),
}

/// Why a stone has no partner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UnmatchedReason {
    /// The second epoch has no points, or no photo that sees them, where the stone should be.
    Unseen,
    /// The second epoch sees the place but has no stone there.
    Lost,
    /// Two candidates are too alike (ratio test), or another stone is the better partner.
    Ambiguous,
    /// The nearest candidate's face is too large or too small: masks merged or split.
    AreaMismatch,
    /// The clouds show something else than masonry, such as a panel of a door.
    NotMasonry,
}

/// The rigid motion of one stone, second epoch minus first, world frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoneMotion {
    /// `p2 = second_from_first * p1`, world frame, metres.
    pub second_from_first: Rigid3,
    /// Displacement of the epoch-1 centroid, (R - I) c + t, metres.
    pub displacement: Vector3<f64>,
    /// Rotation vector, radians.
    pub rotation: Vector3<f64>,
    /// Covariance of (displacement, rotation), absolute, m^2, m rad, rad^2; without registration error of the
    /// epochs.
    pub covariance: Matrix6<f64>,
    /// Parts of the covariance of the displacement that stones share.
    #[serde(default)]
    pub shared: SharedParts,
    /// Displacement against what the neighbours predict, metres.
    pub relative: Vector3<f64>,
    /// Covariance of `relative`, m^2.
    pub relative_covariance: Matrix3<f64>,
    /// Moves unlike its neighbours, significantly (false discovery rate controlled).
    pub loose: bool,
    /// Posterior probability that the stone is loose; `None` where the estimator gives none.
    pub p_loose: Option<f64>,
    /// Share of the least observable direction of the displacement, 0 (not observable) to 1; `sep_obs`.
    pub observability: f64,
    /// RMS of the final residuals along the normal, metres.
    pub rmse_m: f64,
}

/// Parts of the covariance of a displacement, world, m^2; the rest is what the stone's own observations and its neighbours
/// leave open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SharedParts {
    /// By errors that the points of stones share over some length.
    pub points: Matrix3<f64>,
    /// By errors of the poses of photos.
    pub poses: Matrix3<f64>,
}

/// Why a matched stone has no motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
pub enum MotionFailure {
    /// Fewer points than an estimate needs.
    #[error("{first} and {second} points, at least {needed} needed")]
    TooFewPoints {
        /// Points in the first epoch.
        first: usize,
        /// Points in the second epoch.
        second: usize,
        /// Points needed in each.
        needed: usize,
    },
    /// The data do not show the motion along this direction.
    #[error("motion along ({:.2}, {:.2}, {:.2}) is not observable", .direction.x, .direction.y, .direction.z)]
    Unobservable {
        /// World unit vector.
        direction: Vector3<f64>,
    },
    /// The iteration did not settle.
    #[error("no convergence")]
    NotConverged,
    /// The two epochs' points of this stone do not show the same surface (a wrong or spoilt mask).
    #[error("the surfaces of the two epochs do not agree")]
    Disagreement,
}

/// A matched pair and its motion, or the reason why there is none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PairResult {
    /// Stone of the first epoch.
    pub first: StoneId,
    /// Its partner in the second.
    pub second: StoneId,
    /// The part of the wall, joined by ties between neighbours, that the stone belongs to: 1 the largest, 0
    /// where the estimator forms no parts.
    #[serde(default)]
    pub body: u32,
    /// The motion.
    pub motion: Result<StoneMotion, MotionFailure>,
}

/// Covariance of the displacements of two neighbours relative to each other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NeighbourCovariance {
    /// Two stones of the first epoch, the lower number first.
    pub stones: [StoneId; 2],
    /// Covariance of the second stone's displacement less the first stone's, world, m^2; errors that both
    /// have in common cancel.
    pub covariance: Matrix3<f64>,
}

/// The mean of the stones' centroids; the origin for none.
pub fn middle(stones: &[Stone]) -> Point3<f64> {
    let sum: Vector3<f64> = stones.iter().map(|s| s.centroid.coords).sum();
    Point3::from(sum / stones.len().max(1) as f64)
}

/// The common rigid motion of the measured stones that are not loose; `None` where three stones or fewer show
/// none.
///
/// `stones`: of the first epoch. `motions`: by stone of the first epoch.
pub fn common_motion(stones: &[Stone], motions: &BTreeMap<StoneId, &PairResult>) -> Option<SmallMotion> {
    let sample = |stone: &Stone| {
        let motion = motions.get(&stone.id)?.motion.as_ref().ok();
        let motion = motion.filter(|m| !m.loose)?;
        Some(DisplacementSample {
            place: stone.centroid,
            displacement: motion.displacement,
            covariance: motion.covariance.fixed_view::<3, 3>(0, 0).into_owned(),
        })
    };
    SmallMotion::fit(&stones.iter().filter_map(sample).collect::<Vec<_>>())
}
