//! Result tables and the report, made from result files alone.

mod change_points;
mod column_notes;
mod comparison;
mod datum;
mod draw;
mod error;
mod evidence;
mod facade;
mod joints;
mod layer_style;
mod layers;
mod outlines;
mod page;
mod report_file;
mod result_set;
mod statistics;
mod stone_row;
mod stone_table;
mod summary;
#[cfg(test)]
mod testing;

pub use change_points::DistancePoint;
pub use error::ReportError;
pub use evidence::{
    Crop, Cut, EVIDENCE_DIR, Evidence, PosedPhoto, SectionPoint, ThinPoint, crop_side_px, write_cameras,
    write_crops, write_sections, write_thin_cloud,
};
pub use facade::Facade;
pub use joints::{Joint, JointMotion, joints};
pub use layers::{FaceColours, write_layers};
pub use outlines::{OUTLINES_FILE, StoneOutline, read_outlines, write_outlines};
pub use report_file::write_report;
pub use result_set::ResultSet;
pub use stone_row::{RowMotion, Status, StoneRow, detection_limit_m};
pub use stone_table::{STONE_COLUMNS, read_stones, stone_table, write_stones, write_stones_named};
