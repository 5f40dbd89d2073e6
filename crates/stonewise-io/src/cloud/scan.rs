//! The scans that a file keeps apart.

use nalgebra::Point3;

/// One scan of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scan {
    /// Its name, or its number where it has none.
    pub name: String,
    /// Number of records.
    pub records: u64,
    /// Position of the scanner in the world frame, where the file names it.
    pub origin: Option<Point3<f64>>,
    /// Maker, model and serial number of the scanner, as far as the file names them.
    pub sensor: Option<String>,
    /// When it began, seconds of GPS time since 6 January 1980.
    pub begun_s: Option<f64>,
}
