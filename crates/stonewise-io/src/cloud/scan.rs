//! The scans that a file keeps apart.

use nalgebra::Point3;

/// One scan of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Its name, or its number where it has none.
    pub name: String,
    /// Number of records.
    pub records: u64,
    /// Position of the scanner in the world frame, where the file names it.
    pub origin: Option<Point3<f64>>,
}
