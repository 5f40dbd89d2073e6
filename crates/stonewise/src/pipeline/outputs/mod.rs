//! The result files that steps do not write themselves.

pub mod audit;
pub mod carried;
pub mod clouds;
pub mod crs;
pub mod edits;
pub mod evidence;
pub mod face_cloud;
pub mod m3c2;
pub mod outlines;
pub mod run_record;
pub mod series;
pub mod stone_rows;
pub mod verdict;
