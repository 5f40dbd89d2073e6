//! The report, made from result files alone.

mod browser;
mod draw;
mod page;
mod pdf;
mod report_file;
mod summary;
mod tables;
#[cfg(test)]
#[path = "../../../testing/results.rs"]
mod testing;
mod texts;
pub mod verdict;

pub use browser::Browser;
pub use pdf::Pdf;
pub use report_file::write_report;
