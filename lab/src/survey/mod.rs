//! Surveys whose stones are known, ready to be measured.

mod dam_small;
mod points;
mod scanned_wall;

pub use dam_small::{read_points, read_stones};
pub use points::{LEAST_POINTS, Places, Points, SurveyPoint, mean, pairs, places, seen_stone};
pub use scanned_wall::{ScannedWall, sources};
