//! Cells of a grid that starts at the origin of the world.

use nalgebra::Point3;

/// The cell that holds a point, by its lowest corner in cells of `size_m`; points on a border belong to the
/// upper cell.
pub fn cell_of(point: &Point3<f64>, size_m: f64) -> [i64; 3] {
    [0, 1, 2].map(|axis| (point[axis] / size_m).floor() as i64)
}
