//! The result files of a run as types: stones and their columns, outlines, the unrolled wall, joints,
//! evidence, records.

mod budget;
pub mod calendar;
mod change_points;
mod columns;
mod comparison;
mod courses;
mod evidence;
pub mod export;
mod facade;
mod fixed_datum;
mod joints;
pub mod names;
mod neighbours;
mod outlines;
pub mod records;
mod result_set;
mod scale;
mod squares;
mod statistics;
mod stone_row;
mod stone_table;
#[cfg(test)]
#[path = "../../../testing/results.rs"]
mod testing;
mod zone_place;

// What `testing` calls it.
#[cfg(test)]
extern crate self as stonewise_results;

pub use budget::{Budget, Term};
pub use change_points::DistancePoint;
pub use columns::column;
pub use columns::{STONE_COLUMNS, StoneColumn};
pub use comparison::{Comparison, compare};
pub use courses::{StoneCourse, read_courses};
pub use evidence::{
    Crop, Cut, Evidence, Logo, PosedPhoto, SectionPoint, ThinPoint, Tracks, crop_side_px, most_pictured,
    track_side_px, write_cameras, write_crops, write_logo, write_sections, write_thin_cloud, write_tracks,
};
pub use facade::Facade;
pub use fixed_datum::fixed_datum;
pub use joints::{Joint, JointMotion, joints};
pub use neighbours::{read_neighbours, write_neighbours};
pub use outlines::{StoneOutline, read_outlines, write_outlines};
pub use result_set::ResultSet;
pub use result_set::facade_of;
pub use scale::{component_limit_m, nice_scale_m};
pub use squares::Squares;
pub use statistics::Sorted;
pub use stone_row::{Reference, RowMotion, Status, StoneRow, detection_limit_m};
pub use stone_table::{read_stones, stone_table, write_stones, write_stones_csv};
pub use zone_place::ZonePlace;
