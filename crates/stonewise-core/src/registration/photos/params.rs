//! Parameters of the photos' part.

use crate::params::{Params, Range, Ranged, with_ranges};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How stones are tracked from photo to photo, and how far the photos are trusted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct PhotoParams {
    /// Whether stones are tracked in the photos. Where it is off, the clouds alone measure.
    pub enabled: bool,
    /// Error of a photo's pose, pixels on the wall: standard deviation of what its position and of what its
    /// attitude shift. 0.5: that of a bundle adjustment with some dozens of tie points a photo.
    pub pose_error_px: f64,
    /// Whether the camera has a rolling shutter, which exposes the rows of a photo one after the other. If
    /// true, the shift of each photo's last row relative to its first is estimated. false: for a mechanical
    /// or global shutter. Absent: true if a camera file says that the camera
    /// has a rolling shutter, otherwise false.
    pub rolling_shutter: Option<bool>,
    /// Photos of a stone that are used in each epoch, at most; the sharpest come first. 8: more gain nothing,
    /// as the appearance of a stone is wrong alike in all photos of an epoch.
    pub max_photos: usize,
    /// Photos that must show a stone in each epoch. 2: four pairs, of different parallax.
    pub min_photos: usize,
    /// Width of a stone's rim that is left out, metres. 0.02: shadows in the joints and the neighbours' edges
    /// move with the sun.
    pub rim_m: f64,
    /// Standard deviation of the window in which contrast is normalised, metres. 0.009: shorter than shadows,
    /// damp patches and the relief that the sun's direction changes, longer than the grain of stone.
    pub normalise_m: f64,
    /// Correlation of a photo with the stone's template below which the photo is left out for this stone.
    /// 0.4: that of equal parts of signal and of something else.
    pub min_correlation: f64,
    /// A stone is sought this far from where the clouds put it, metres, and farther by three standard
    /// deviations of that place. 0.01: what poses and epochs may be apart.
    pub search_m: f64,
    /// A stone is never sought farther, metres. 0.04: half a course of small bricks, so that a stone is not taken
    /// for its neighbour.
    pub max_search_m: f64,
}

impl Default for PhotoParams {
    fn default() -> Self {
        Self {
            enabled: true,
            pose_error_px: 0.5,
            rolling_shutter: None,
            max_photos: 8,
            min_photos: 2,
            rim_m: 0.02,
            normalise_m: 0.009,
            min_correlation: 0.4,
            search_m: 0.01,
            max_search_m: 0.04,
        }
    }
}

impl Params for PhotoParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::NOT_NEGATIVE.holds("pose_error_px", self.pose_error_px),
            Range::NOT_NEGATIVE.holds("max_photos", self.max_photos),
            Range::NOT_NEGATIVE.holds("min_photos", self.min_photos),
            Range::NOT_NEGATIVE.holds("rim_m", self.rim_m),
            Range::NOT_NEGATIVE.holds("normalise_m", self.normalise_m),
            Range::NOT_NEGATIVE.holds("min_correlation", self.min_correlation),
            Range::NOT_NEGATIVE.holds("search_m", self.search_m),
            Range::NOT_NEGATIVE.holds("max_search_m", self.max_search_m),
        ]
    }
}

impl PhotoParams {
    /// How far beyond a stone's face photos are looked at, metres: the search, and the window in which
    /// contrast is normalised.
    pub fn margin_m(&self) -> f64 {
        self.margin_around_m(self.max_search_m)
    }

    /// The margin for a search that goes this far, metres.
    pub(super) fn margin_around_m(&self, search_m: f64) -> f64 {
        search_m + WINDOW_SDS * OTHER_WINDOW * self.normalise_m
    }
}

/// Reach of the window in which contrast is normalised, standard deviations: beyond three its weights are
/// below one percent.
pub(super) const WINDOW_SDS: f64 = 3.0;
/// Width of the window of the other normalisation, which must agree, over that of the first: different enough
/// to weigh other parts of the picture, and still narrower than a stone.
pub(super) const OTHER_WINDOW: f64 = 5.0 / 3.0;
