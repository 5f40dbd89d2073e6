//! `registration.json`: what the estimator says about itself, and the registration of the epochs.

use super::Datum;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use stonewise_core::registration::observers::{EpochErrors, ObserverComponents, SensorClass};
use stonewise_core::registration::photos::PhotoStatus;
use stonewise_core::registration::{
    AdjustmentReport, Break, Deformation, DeformationZone, StonePhotoReport, VarianceComponents,
};
use stonewise_core::stone::PairResult;

/// What is known about the motions of one pair of epochs as a whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RegistrationRecord {
    /// The estimator and what it found.
    #[serde(flatten)]
    pub estimator: EstimatorRecord,
    /// The registration of the later epoch.
    pub datum: Datum,
    /// What stations, strips and stable areas show of the error of the later epoch; absent where nothing was
    /// compared.
    pub observers: Option<ObserversRecord>,
    /// Whether and where the wall deformed; absent if the estimator gives no joint distribution of the motions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deformation: Option<DeformationRecord>,
    /// Checks of the run, also those that passed.
    #[serde(default)]
    pub checks: Vec<CheckRecord>,
    /// What each source, stable area, instrument in use and known length does to the results.
    #[serde(default)]
    pub influence: Vec<InfluenceRecord>,
}

/// What a source, stable area, instrument or known length does to the results: reliability (Baarda 1968), and the motions
/// without it, with the variances and weights of all.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InfluenceRecord {
    /// Its name, in the language of the report.
    pub name: String,
    /// Sum of the redundancy numbers of its observations.
    pub redundancy: f64,
    /// Smallest offset of it as a whole that a test against all others finds, with a significance level of 0.1 % and a
    /// power of 80 %, in the worst of the directions that it shows, millimetres; null where it shows none.
    pub smallest_blunder_mm: Option<f64>,
    /// Length that the largest motion of the verdict would have without it, millimetres; null where no stone moved, where
    /// nothing else shows the stone, and where the datum would be unknown or is not estimated.
    pub largest_motion_without_mm: Option<f64>,
    /// Largest change of a stone's motion without it, millimetres; null where the datum would be unknown or is not
    /// estimated.
    pub shift_mm: Option<f64>,
}

/// A check of the results: its statistic lies on the right side of its limit where it passed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckRecord {
    /// Name under which `stonewise explain` says more of it.
    pub name: String,
    /// The statistic in plain words, in the language of the report.
    pub what: String,
    /// The epoch that it is about.
    pub epoch: String,
    /// What was found.
    pub statistic: f64,
    /// What it is compared with.
    pub limit: f64,
    /// Whether the limit is the least value that passes, not the largest.
    pub at_least: bool,
    /// Where the limit is from, in the language of the report.
    pub source: String,
    /// Whether it passed.
    pub passed: bool,
    /// What to do, in the language of the report; absent where it passed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
}

/// Whether and where the wall deformed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeformationRecord {
    /// Probability of so large a deformation on a wall that moved as one rigid body; absent where no part of the wall
    /// has stones enough.
    pub p: Option<f64>,
    /// Bulge that is found in 95 of 100 cases, of a zone of 1, 3 and 10 m, metres; absent where the wall is
    /// smaller.
    pub detection_limits_m: [Option<f64>; 3],
    /// Motion of a zone of 1, 3 and 10 m in the face that is found in 95 of 100 cases, along the wall or up, whichever
    /// is found worse, metres; absent where the wall is smaller.
    #[serde(default)]
    pub limits_in_face_m: [Option<f64>; 3],
    /// The zones, the one of the largest deformation first.
    pub zones: Vec<DeformationZone>,
}

impl From<&Deformation> for DeformationRecord {
    fn from(found: &Deformation) -> Self {
        Self {
            p: found.p,
            detection_limits_m: found.detection_limits_m,
            limits_in_face_m: found.limits_in_face_m,
            zones: found.zones.clone(),
        }
    }
}

/// What stations, strips and stable areas show.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObserversRecord {
    /// Class of the sensor, by the noise of its points.
    pub sensor: SensorClass,
    /// Error that all sources of an epoch are assumed to share, per axis, metres.
    pub assumed_shared_error_m: f64,
    /// Non-rigid part of an epoch's registration error, per axis, metres: assumed where the datum is unknown
    /// and files keep no stations or strips apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assumed_merged_error_m: Option<f64>,
    /// Variances of the sources' errors; absent where an epoch has no two sources that overlap.
    pub components: Option<ObserverComponents>,
    /// Dimensionless stretch in the face, one value per epoch: each source is stretched about the middle of
    /// what it sees; absent for airborne sensors and where no sources overlap.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stretch: Option<[f64; 2]>,
    /// Twice the log likelihood that errors of the sources gain over none.
    pub significance: f64,
    /// Stones on which sources were compared, per epoch.
    pub compared_stones: [usize; 2],
    /// Plane cells in stable areas.
    pub stable_cells: usize,
    /// Apparent shift of the middle of the wall and rotation vector about it, m, rad; what is taken off the
    /// motions where the datum is known from stable areas or sources.
    pub error: [f64; 6],
}

impl From<&EpochErrors> for ObserversRecord {
    fn from(errors: &EpochErrors) -> Self {
        Self {
            sensor: errors.class,
            assumed_shared_error_m: errors.shared_error_m,
            assumed_merged_error_m: errors.merged_error_m,
            components: errors.components,
            stretch: errors.stretch,
            significance: errors.significance,
            compared_stones: [errors.observations[0], errors.observations[1]],
            stable_cells: errors.observations[2],
            error: errors.rigid.error.into(),
        }
    }
}

/// What an estimator says about itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "estimator", rename_all = "snake_case")]
pub enum EstimatorRecord {
    /// All stones together.
    Adjustment(Box<AdjustmentRecord>),
    /// Each stone by itself.
    Gicp(GicpRecord),
}

/// The adjustment of all stones together. Absent numbers were not estimated, for lack of stones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AdjustmentRecord {
    /// Whether the last iteration moved no stone beyond the tolerance.
    pub converged: bool,
    /// Iterations made.
    pub iterations: usize,
    /// Noise of the points along the normal per epoch, metres.
    pub noise_m: [Option<f64>; 2],
    /// Roughness of the stones: standard deviation of a second difference over one cell, metres.
    pub roughness_m: Option<f64>,
    /// Cell of the surface grid, metres.
    pub surface_cell_m: Option<f64>,
    /// Factor by which correlation between points raises variances; 1 for independent noise.
    pub correlation_factor: Option<f64>,
    /// How unlike neighbours move.
    pub variance_components: VarianceComponents,
    /// Mean motion of all stones that are not loose, world, metres: a check of the datum.
    pub common_motion_m: [f64; 3],
    /// Covariance of the mean motion, m^2, row by row; without registration error of the epochs.
    pub common_motion_covariance_m2: [[f64; 3]; 3],
    /// Number of loose stones.
    pub loose: usize,
    /// Neighbours between which the field of motion broke.
    pub breaks: Vec<Break>,
    /// What photos contributed; absent where they took no part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub photos: Option<PhotosRecord>,
}

/// What photos contributed to the adjustment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhotosRecord {
    /// How many stones have which status.
    pub statuses: BTreeMap<PhotoStatus, usize>,
    /// Factor on the formal standard deviations of matches, from their residuals.
    pub sigma_factor: f64,
    /// Scale of a stone's appearance bias between the epochs, metres: of Student's t with eight degrees of
    /// freedom.
    pub appearance_m: f64,
    /// Each photo: name, and root mean square of what the correction of its pose shifts, pixels.
    pub poses_px: Vec<(String, f64)>,
    /// Shift of each photo's last row relative to its first, along the rows and along the columns, pixels, in
    /// the order of `poses_px`; absent if the shift is not estimated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rows_px: Vec<[f64; 2]>,
    /// Each stone of the first epoch, ascending.
    pub stones: Vec<StoneInPhotosRecord>,
}

/// What the photos say of one stone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoneInPhotosRecord {
    /// Stone of the first epoch.
    pub stone_id: u32,
    /// What the photos say.
    #[serde(flatten)]
    pub photos: StonePhotoReport,
}

impl PhotosRecord {
    /// From what the adjustment says; `None` where photos took no part.
    pub fn of(report: &AdjustmentReport) -> Option<Self> {
        let photos = report.photos.as_ref()?;
        let mut statuses = BTreeMap::new();
        for stone in &photos.stones {
            *statuses.entry(stone.status).or_default() += 1;
        }
        let of_stone = |(pair, photos): (&PairResult, &StonePhotoReport)| StoneInPhotosRecord {
            stone_id: pair.first.0,
            photos: *photos,
        };
        let stones = report.results.iter().zip(&photos.stones).map(of_stone);
        let mut stones: Vec<StoneInPhotosRecord> = stones.collect();
        stones.sort_by_key(|s| s.stone_id);
        Some(Self {
            statuses,
            sigma_factor: photos.sigma_factor,
            appearance_m: photos.appearance_m,
            poses_px: photos.poses_px.clone(),
            rows_px: photos.rows_px.clone(),
            stones,
        })
    }
}

/// Plane-to-plane ICP of every stone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GicpRecord {
    /// Matched stones.
    pub stones: usize,
    /// Measured ones among them.
    pub measured: usize,
    /// Loose ones among these.
    pub loose: usize,
}

impl EstimatorRecord {
    /// Whether the estimate settled; every stone of its own estimate has a status instead.
    pub fn converged(&self) -> bool {
        match self {
            Self::Adjustment(adjustment) => adjustment.converged,
            Self::Gicp(_) => true,
        }
    }
}
