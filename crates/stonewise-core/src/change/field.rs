//! What a comparison along normals gives.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

/// Change at many core points, in the order of the core points.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChangeField {
    /// One entry per core point.
    pub points: Vec<ChangePoint>,
}

/// Change at one core point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangePoint {
    /// Core point, world frame, metres.
    pub position: Point3<f64>,
    /// Unit vector along which the distance is measured, out of the wall; NaN where no plane shows it.
    pub normal: Vector3<f64>,
    /// Second epoch minus first along the normal, metres; `None` where a cylinder is empty.
    pub distance_m: Option<f64>,
    /// Smallest distance that is significant at 95 %, metres; `None` where too few points tell the spread.
    pub detection_limit_m: Option<f64>,
    /// Spread of either epoch's points along the normal, metres: standard deviation, or interquartile range.
    pub spread_m: [Option<f64>; 2],
    /// Number of points in either epoch's cylinder.
    pub counts: [u32; 2],
}

impl ChangePoint {
    pub(super) fn without_normal(position: Point3<f64>) -> Self {
        Self {
            position,
            normal: Vector3::repeat(f64::NAN),
            distance_m: None,
            detection_limit_m: None,
            spread_m: [None; 2],
            counts: [0; 2],
        }
    }

    /// Whether the distance exceeds its detection limit.
    pub fn is_significant(&self) -> bool {
        matches!((self.distance_m, self.detection_limit_m), (Some(d), Some(limit)) if d.abs() > limit)
    }

    /// The displacement that the distance stands for: distance times normal, metres.
    pub fn displacement(&self) -> Option<Vector3<f64>> {
        self.distance_m.map(|d| self.normal * d)
    }
}
