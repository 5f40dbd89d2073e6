//! The lidar on a drone and the photos of a planned survey.

use super::values::{count, not_negative, positive};
use serde::{Deserialize, Serialize};
use stonewise_simulate::{BeamParams, PhotoParams, UavParams};

/// Most strips, and most photos along the wall and above each other.
const MOST: u32 = 1000;
/// Most photos of a survey, and most points of a flight.
const MOST_PHOTOS: u32 = 2000;
const MOST_POINTS: f64 = 1e9;
/// Smallest and largest side of a photo, pixels.
const SIDE_PX: [u32; 2] = [16, 20_000];

/// A flight with a lidar, in strips along the wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlannedDrone {
    /// Number of strips, one above the other.
    pub strips: u32,
    /// Distance of the strips from the face, metres.
    pub distance_m: f64,
    /// Mean point distance of all strips together, metres.
    pub spacing_m: f64,
    /// Range noise at 10 m, square on, metres.
    pub range_noise_m: f64,
    /// Error that the whole flight shares, per axis, standard deviation, metres. Absent: 1.5 mm, and the run
    /// assumes what it does where a project states nothing.
    pub datum_m: Option<f64>,
    /// Error that drifts along a strip, per axis, standard deviation, metres.
    pub drift_m: f64,
    /// Whether the flight is a candidate, which may be added to the survey.
    pub candidate: bool,
}

impl Default for PlannedDrone {
    fn default() -> Self {
        let uav = UavParams::default();
        Self {
            strips: uav.strips,
            distance_m: uav.distance_m,
            spacing_m: uav.spacing_m,
            range_noise_m: uav.beam.range_noise_m,
            datum_m: None,
            drift_m: uav.drift_m,
            candidate: false,
        }
    }
}

impl PlannedDrone {
    pub(super) fn check(&self, [width_m, height_m]: [f64; 2]) -> Result<(), String> {
        count("drone.strips", self.strips, 1..=MOST)?;
        positive("drone.distance_m", self.distance_m)?;
        positive("drone.spacing_m", self.spacing_m)?;
        not_negative("drone.range_noise_m", self.range_noise_m)?;
        not_negative("drone.datum_m", self.datum_m.unwrap_or(0.0))?;
        not_negative("drone.drift_m", self.drift_m)?;
        let points = width_m * height_m / self.spacing_m.powi(2);
        match points > MOST_POINTS {
            true => Err(format!(
                "drone.spacing_m = {}: the wall would have {points:.1e} points; at most {MOST_POINTS:.0e} are simulated",
                self.spacing_m
            )),
            false => Ok(()),
        }
    }

    /// The flight as the simulator flies it.
    pub(super) fn params(&self) -> UavParams {
        let usual = UavParams::default();
        UavParams {
            strips: self.strips,
            distance_m: self.distance_m,
            spacing_m: self.spacing_m,
            datum_m: self.datum_m.unwrap_or(usual.datum_m),
            drift_m: self.drift_m,
            beam: BeamParams {
                range_noise_m: self.range_noise_m,
                ..BeamParams::airborne()
            },
            ..usual
        }
    }
}

/// Photos of the wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlannedPhotos {
    /// Distance from the face, metres.
    pub distance_m: f64,
    /// Photos along the wall; absent: as many as put them half of their width apart.
    pub columns: Option<u32>,
    /// Photos above each other; absent: as many as put them half of their height apart.
    pub rows: Option<u32>,
    /// Image width, pixels.
    pub width_px: u32,
    /// Image height, pixels.
    pub height_px: u32,
    /// Focal length, pixels.
    pub focal_px: f64,
    /// Error of a photo's pose, pixels on the wall: standard deviation of what its position and of what its attitude
    /// shift. Absent: 0.3 each, and the run assumes what it does where a project states nothing.
    pub pose_error_px: Option<f64>,
    /// Whether measuring in photos is a candidate, which may be added to the survey.
    pub candidate: bool,
}

impl Default for PlannedPhotos {
    fn default() -> Self {
        let photos = PhotoParams::default();
        Self {
            distance_m: photos.distance_m,
            columns: None,
            rows: None,
            width_px: photos.width,
            height_px: photos.height,
            focal_px: photos.focal_px,
            pose_error_px: None,
            candidate: false,
        }
    }
}

impl PlannedPhotos {
    /// Photos that show where the stones are, and nothing else.
    pub(super) fn that_find() -> Self {
        Self {
            width_px: 1200,
            height_px: 900,
            focal_px: 1200.0,
            ..Self::default()
        }
    }

    pub(super) fn check(&self, size_m: [f64; 2]) -> Result<(), String> {
        positive("photos.distance_m", self.distance_m)?;
        positive("photos.focal_px", self.focal_px)?;
        count("photos.columns", self.columns.unwrap_or(1), 1..=MOST)?;
        count("photos.rows", self.rows.unwrap_or(1), 1..=MOST)?;
        count("photos.width_px", self.width_px, SIDE_PX[0]..=SIDE_PX[1])?;
        count("photos.height_px", self.height_px, SIDE_PX[0]..=SIDE_PX[1])?;
        not_negative("photos.pose_error_px", self.pose_error_px.unwrap_or(0.0))?;
        let PhotoParams { columns, rows, .. } = self.params(size_m);
        match columns * rows > MOST_PHOTOS {
            true => Err(format!(
                "photos: {columns} x {rows} photos show the wall from photos.distance_m = {} with photos.focal_px = {}; \
                 at most {MOST_PHOTOS} are simulated",
                self.distance_m, self.focal_px
            )),
            false => Ok(()),
        }
    }

    /// The photos as the simulator takes them of a wall of this width and height, metres, rendered.
    pub(super) fn params(&self, [width_m, height_m]: [f64; 2]) -> PhotoParams {
        let shown_m = |side_px: u32| self.distance_m * f64::from(side_px) / self.focal_px;
        let across =
            |size_m: f64, shown_m: f64| (size_m / (0.5 * shown_m)).ceil().clamp(2.0, MOST.into()) as u32;
        let usual = PhotoParams::default();
        PhotoParams {
            columns: (self.columns).unwrap_or_else(|| across(width_m, shown_m(self.width_px))),
            rows: (self.rows).unwrap_or_else(|| across(height_m, shown_m(self.height_px))),
            width: self.width_px,
            height: self.height_px,
            focal_px: self.focal_px,
            distance_m: self.distance_m,
            // The simulator's error is that of position and attitude together.
            pose_noise_px: self
                .pose_error_px
                .map_or(usual.pose_noise_px, |px| px * 2f64.sqrt()),
            ..usual
        }
    }
}
