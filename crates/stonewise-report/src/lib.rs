//! The report, made from result files alone.
//!
//! ```no_run
//! // The folder of a finished run; the report is one HTML file in it.
//! let page = stonewise_report::write_report("results".as_ref())?;
//! println!("{}", page.display());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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
