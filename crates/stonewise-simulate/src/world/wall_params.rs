//! What a simulated wall is built from.

use serde::{Deserialize, Serialize};

/// Size and style of a wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WallParams {
    /// Length of the section along the dam, metres.
    pub width_m: f64,
    /// Height above ground, measured in the face, metres.
    pub height_m: f64,
    /// How far the masonry goes on below ground, metres: the lowest stones are half buried, as on real walls.
    pub foot_m: f64,
    /// Horizontal lean per metre of height; 1:0.2 as at gravity dams of about 1900.
    pub batter: f64,
    /// Radius of the plan, metres, 0 = straight; positive = the visible face is hollow.
    pub plan_radius_m: f64,
    /// Mean height of a course, metres.
    pub course_m: f64,
    /// Mean width of a stone over its height.
    pub aspect: f64,
    /// Share of stones that span two courses.
    pub tall_share: f64,
    /// Share of places of tall courses that hold two thin stones.
    pub split_share: f64,
    /// Smallest and largest joint width, metres.
    pub joint_width_m: [f64; 2],
    /// Smallest and largest depth of the mortar behind the idealised face, metres.
    pub joint_depth_m: [f64; 2],
    /// Factor on the relief of all stones; 1 gives slopes of about 0.2 rms.
    pub relief: f64,
    /// Share of stones that are almost flat, and so hardly show a motion in their own plane.
    pub flat_share: f64,
    /// Seed of everything in the wall.
    pub seed: u64,
}

impl WallParams {
    /// The default wall in another width and height, metres.
    pub fn sized([width_m, height_m]: [f64; 2]) -> Self {
        Self {
            width_m,
            height_m,
            ..Self::default()
        }
    }
}

impl Default for WallParams {
    fn default() -> Self {
        Self {
            width_m: 4.0,
            height_m: 3.0,
            foot_m: 0.25,
            batter: 0.2,
            plan_radius_m: 0.0,
            course_m: 0.21,
            aspect: 1.35,
            tall_share: 0.17,
            split_share: 0.14,
            joint_width_m: [0.01, 0.03],
            joint_depth_m: [0.01, 0.03],
            relief: 1.0,
            flat_share: 0.1,
            seed: 1,
        }
    }
}
