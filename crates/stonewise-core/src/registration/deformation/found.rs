//! What was found of the deformation.

use crate::id::StoneId;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Extents of zones for which detection limits are given, metres.
pub const ZONE_EXTENTS_M: [f64; 3] = [1.0, 3.0, 10.0];
/// Probability of a still wall to be called deformed. 0.01: at 0.05, errors outside the model
/// (masks, few points) made it 0.12 on simulated surveys (3 of 25).
pub(super) const LEVEL: f64 = 0.01;
/// What intervals leave outside.
pub(super) const OUTSIDE: f64 = 0.05;

/// How the wall deformed between two epochs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Deformation {
    /// Deformation of each measured stone whose part of the wall has stones enough, ascending.
    pub stones: Vec<StoneDeformation>,
    /// Probability of so large a deformation by chance; `None` where no part of the wall has stones enough.
    pub p: Option<f64>,
    /// Smallest bulge out of the wall that is found in 95 of 100 cases, in the median over the wall, for each of
    /// [`ZONE_EXTENTS_M`]; `None` where the wall is smaller. Metres.
    pub detection_limits_m: [Option<f64>; 3],
    /// Smallest motion of a zone in the face that is found in 95 of 100 cases, along the wall or up, whichever is found
    /// worse, in the median over the wall, for each of [`ZONE_EXTENTS_M`]; `None` where the wall is smaller. Metres.
    pub limits_in_face_m: [Option<f64>; 3],
    /// Zones that deformed, the one of the largest motion first; none unless `p` is at most 1 %.
    pub zones: Vec<DeformationZone>,
}

impl Deformation {
    /// Whether a deformation is shown.
    pub fn is_shown(&self) -> bool {
        self.p.is_some_and(|p| p <= LEVEL)
    }
}

/// The deformation of a stone; world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoneDeformation {
    /// Stone of the first epoch.
    pub stone: StoneId,
    /// Its motion less that of the rigid part, metres.
    pub deformation: Vector3<f64>,
    /// Its covariance, m^2.
    pub covariance: Matrix3<f64>,
    /// The part of it that allows for what the field of motions has smoothed of a zone, m^2; it errs alike in epochs
    /// that show the same motion.
    pub smoothed: Matrix3<f64>,
    /// Number of its zone, of several that of the largest deformation, 0 for none.
    pub zone: u32,
}

impl StoneDeformation {
    /// Its covariance without the part for smoothed zones, m^2.
    pub fn covariance_without_zones(&self) -> Matrix3<f64> {
        self.covariance - self.smoothed
    }
}

/// A zone that deformed: the stones around a peak of the deformation that moved by more than half of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeformationZone {
    /// From 1.
    pub number: u32,
    /// Its stones, ascending.
    pub stones: Vec<StoneId>,
    /// Diameter of a round zone, whose length and width differ by less than the distance of neighbours, metres.
    pub diameter_m: Option<f64>,
    /// Length of the ellipse of the same second moments, metres.
    pub length_m: f64,
    /// Its width, metres.
    pub width_m: f64,
    /// Length of the largest deformation, metres.
    pub largest_m: f64,
    /// Its 95 % interval, metres.
    pub interval_m: [f64; 2],
    /// Mean deformation along the wall, up and out, metres.
    pub mean_m: Vector3<f64>,
    /// What it resembles.
    pub kind: ZoneKind,
    /// What its motion counts from.
    pub against: Against,
}

/// What a zone of deformation resembles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ZoneKind {
    /// It moved out of the wall or into it, most in its middle.
    Bulge,
    /// It moved out of the wall or into it, more and more towards one side.
    Lean,
    /// It sank.
    Settlement,
    /// It moved out of the wall or into it as a whole.
    Step,
    /// It rose or moved along the wall.
    Other,
}

impl ZoneKind {
    /// The word in result files.
    pub fn word(self) -> &'static str {
        match self {
            Self::Bulge => "bulge",
            Self::Lean => "lean",
            Self::Settlement => "settlement",
            Self::Step => "step",
            Self::Other => "other",
        }
    }
}

/// What the motion of a zone counts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// The part of the wall that kept its shape.
    RestOfWall,
    /// That of its own part of the wall, where no ties join all parts.
    RestOfPart,
}

impl Against {
    /// The word in result files.
    pub fn word(self) -> &'static str {
        match self {
            Self::RestOfWall => "rest_of_wall",
            Self::RestOfPart => "rest_of_part",
        }
    }
}
