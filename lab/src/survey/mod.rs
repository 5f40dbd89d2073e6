//! Surveys whose stones are known, ready to be measured.

mod dam_small;
mod points;
mod scanned_wall;

pub use dam_small::{read_points, read_stones};
pub use points::{Places, mean, pairs, places};
pub use scanned_wall::{ScannedWall, sources};
