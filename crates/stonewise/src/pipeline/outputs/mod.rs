//! The result files that steps do not write themselves.

mod audit;
pub mod audits;
mod carried;
pub mod clouds;
pub mod crs;
mod edits;
pub mod evidence;
pub mod face_cloud;
pub mod influence;
pub mod instruments;
pub mod m3c2;
pub mod m3c2_recipes;
pub mod outlines;
pub mod report;
pub mod run_record;
pub mod series;
pub mod stone_rows;
pub mod tables;
pub mod time_order;
mod trend_groups;
pub mod trends;
pub mod verdict;
pub mod zones;
