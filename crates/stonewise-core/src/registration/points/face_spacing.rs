//! Distance between the neighbouring points of a stone.

use crate::cloud::Cloud;
use crate::geometry::FaceFrame;
use nalgebra::Vector3;
use std::collections::BTreeSet;

/// Cells in which a face's area is counted, metres: some dozens on a stone, each with some points of a sparse
/// drone cloud.
const AREA_CELL_M: f64 = 0.02;

/// Mean distance of neighbouring points, seen along the normal, metres; 0 without points.
///
/// The root of the area that each point has for itself; the area is that of all cells with points, so that it
/// is too large where a cell has less than one point on average.
pub fn face_spacing(cloud: &Cloud, normal: &Vector3<f64>) -> f64 {
    let frame = FaceFrame::from_normal(normal);
    let cell = |i: usize| {
        let at = |axis: &Vector3<f64>| (cloud.local(i).coords.dot(axis) / AREA_CELL_M).floor() as i64;
        (at(&frame.along), at(&frame.up))
    };
    let cells: BTreeSet<(i64, i64)> = (0..cloud.len()).map(cell).collect();
    AREA_CELL_M * (cells.len() as f64 / cloud.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Rotation3};

    /// A grid of 0.4 x 0.4 m in the plane of `normal`, with a point every `step_m`.
    fn grid(step_m: f64, normal: &Vector3<f64>) -> Cloud {
        let frame = FaceFrame::from_normal(normal);
        let side = (0.4 / step_m).round() as i32;
        let at = |i: i32| (f64::from(i) + 0.5) * step_m - 0.2;
        let points = (0..side).flat_map(|i| (0..side).map(move |j| (i, j)));
        let place = |(i, j)| Point3::from(frame.along * at(i) + frame.up * at(j));
        Cloud::from_world(Point3::origin(), points.map(place))
    }

    #[test]
    fn the_step_of_a_grid_is_found_in_any_plane() {
        let turn = Rotation3::from_euler_angles(0.3, -0.2, 0.7);
        for normal in [Vector3::y(), turn * Vector3::y()] {
            for step_m in [0.002, 0.005, 0.01] {
                // The grid fills its 20 x 20 cells.
                let found = face_spacing(&grid(step_m, &normal), &normal);
                assert!((found / step_m - 1.0).abs() < 1e-6, "{step_m}: {found}");
            }
        }
    }

    #[test]
    fn a_cloud_without_points_has_no_spacing() {
        let empty = Cloud::new(Point3::origin(), Vec::new());
        assert_eq!(face_spacing(&empty, &Vector3::y()), 0.0);
    }
}
