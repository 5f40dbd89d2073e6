//! The figures of planned surveys.

use super::squares::Weakest;
use crate::results::records::DatumState;
use serde::Serialize;

/// What a planned survey will see.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlannedSurvey {
    /// Names of the stations.
    pub stations: Vec<String>,
    /// Whether a lidar on a drone scans the wall.
    pub drone: bool,
    /// Number of photos that measure, in each epoch.
    pub photos: u32,
    /// Whether stable targets give the frame.
    pub targets: bool,
    /// What is added: the name of a station, `drone`, `photos` or `targets`; absent for the survey as it is planned.
    pub added: Option<String>,
    /// Stones of the wall above ground, and those of them that will be measured.
    pub stones: [usize; 2],
    /// What is known of the registration of such a survey.
    pub datum: DatumState,
    /// Median standard deviations of a stone's motion along the wall, up and out, millimetres.
    pub sd_mm: [Option<f64>; 3],
    /// Median standard deviations of a stone's deformation along the wall, up and out, millimetres.
    pub sd_deformation_mm: [Option<f64>; 3],
    /// Smallest bulge of 1, 3 and 10 m that is found in 95 of 100 cases, millimetres; absent where the wall is smaller.
    pub zones_mm: [Option<f64>; 3],
    /// The same for a zone that moves in the face, along it or up, whichever is found worse.
    pub zones_in_face_mm: [Option<f64>; 3],
    /// Squares of the wall, and those in which most stones will not be measured.
    pub squares: [usize; 2],
    /// The square that is measured worst of those in which most stones are measured.
    pub weakest: Option<Weakest>,
}

/// A planned survey, and what each candidate makes of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanDesign {
    /// Seed of the wall and of all errors.
    pub seed: u64,
    /// Without any candidate.
    pub planned: PlannedSurvey,
    /// With one candidate, the best first: fewest squares that are not seen, then the smallest standard deviation in the
    /// weakest square.
    pub with_candidate: Vec<PlannedSurvey>,
}
