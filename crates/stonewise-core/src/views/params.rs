//! Parameters of the views of a cloud.

use super::Shade;
use crate::params::{Params, Range, Ranged, with_ranges};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How views of a cloud are made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct ViewParams {
    /// What the pixels show. Absent: the best that the points have.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub show: Option<Shade>,
    /// Whether the detector also looks at views in epochs that have photos and no masks.
    pub beside_photos: bool,
    /// A place from which the wall is seen, world frame, metres: says which side is outside. Absent: the positions
    /// of scanners or cameras say it, else what the clouds show.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outside: Option<[f64; 3]>,
    /// Edge of the cells whose normals decide where cameras stand, metres: about one stone, so that its relief
    /// does not count.
    pub cell_m: f64,
    /// Distance of the cameras from the wall, metres: far enough that stones a decimetre before or behind the
    /// face have the same scale within 1 %.
    pub distance_m: f64,
    /// Angle by which views to the left, to the right, from above and from below are turned, radians.
    pub turn_rad: f64,
    /// Normals within this angle of the axis of a view are seen well, radians.
    pub spread_rad: f64,
    /// Least size of a pixel on the wall, metres. A pixel is 0.6 times as large as the spacing of the points.
    pub pixel_m: f64,
    /// Pixels of all views of an epoch together, millions. If there are more, pixels grow until they fit or until stones
    /// are only `stone_px` across.
    pub megapixels: f64,
    /// Least size of the smaller stones of a first look, pixels across (lower quartile of the square roots of their
    /// areas), to which `megapixels` may reduce them.
    pub stone_px: f64,
    /// Pixels of all views of an epoch together at most, millions; pixels grow until they fit, even if stones are then
    /// less than `stone_px` across.
    pub most_megapixels: f64,
    /// Longest side of a view, pixels.
    pub side_px: u32,
}

impl Default for ViewParams {
    fn default() -> Self {
        Self {
            show: None,
            beside_photos: false,
            outside: None,
            cell_m: 0.25,
            distance_m: 12.0,
            turn_rad: 0.4,
            spread_rad: 0.6,
            pixel_m: 0.003,
            megapixels: 40.0,
            stone_px: 50.0,
            most_megapixels: 1000.0,
            side_px: 1600,
        }
    }
}

impl Params for ViewParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::POSITIVE.holds("cell_m", self.cell_m),
            Range::POSITIVE.holds("distance_m", self.distance_m),
            Range::NOT_NEGATIVE.holds("turn_rad", self.turn_rad),
            Range::POSITIVE.holds("spread_rad", self.spread_rad),
            Range::NOT_NEGATIVE.holds("pixel_m", self.pixel_m),
            Range::POSITIVE.holds("megapixels", self.megapixels),
            Range::POSITIVE.holds("stone_px", self.stone_px),
            Range::POSITIVE.holds("most_megapixels", self.most_megapixels),
            Range::POSITIVE.holds("side_px", self.side_px),
        ]
    }
}
