//! The result files of a run as types: stones and their columns, outlines, the unrolled wall, joints,
//! evidence, records.

mod change_points;
mod columns;
mod comparison;
mod evidence;
mod facade;
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
pub(crate) mod testing;

pub use change_points::DistancePoint;
pub(crate) use columns::column;
pub use columns::{STONE_COLUMNS, StoneColumn};
pub(crate) use comparison::{Comparison, compare};
pub use evidence::{
    Crop, Cut, Evidence, Logo, PosedPhoto, SectionPoint, ThinPoint, Tracks, crop_side_px, most_pictured,
    track_side_px, write_cameras, write_crops, write_logo, write_sections, write_thin_cloud, write_tracks,
};
pub use facade::Facade;
pub use joints::{Joint, JointMotion, joints};
pub(crate) use neighbours::{read_neighbours, write_neighbours};
pub use outlines::{StoneOutline, read_outlines, write_outlines};
pub use result_set::ResultSet;
pub(crate) use result_set::facade_of;
pub(crate) use scale::{component_limit_m, nice_scale_m};
pub(crate) use squares::Squares;
pub(crate) use statistics::Sorted;
pub use stone_row::{Reference, RowMotion, Status, StoneRow, detection_limit_m};
pub use stone_table::{read_stones, stone_table, write_stones};
