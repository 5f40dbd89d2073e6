//! The report, made from result files alone.

mod draw;
mod page;
mod report_file;
mod summary;

pub use report_file::write_report;
