//! Core points: where two clouds are compared.

use super::normals::{OutwardReference, estimate_normals};
use crate::cloud::GridIndex;
use crate::geometry::{CellMap, floor};
use nalgebra::{Point3, Vector3};

/// A place at which two clouds are compared along a normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorePoint {
    /// World frame, metres.
    pub position: Point3<f64>,
    /// Unit vector out of the wall; `None` where no plane shows it.
    pub normal: Option<Vector3<f64>>,
}

impl CorePoint {
    /// Core points at these positions with normals fitted to a cloud; see [`estimate_normals`].
    pub fn fitted(
        cloud: &GridIndex,
        positions: &[Point3<f64>],
        radius_m: f64,
        outward: &OutwardReference<'_>,
    ) -> Vec<Self> {
        let normals = estimate_normals(cloud, positions, radius_m, outward);
        let both = positions.iter().zip(normals);
        both.map(|(&position, normal)| Self { position, normal })
            .collect()
    }
}

/// Indices of the points that stay when every voxel keeps only the point nearest to its middle.
///
/// Voxels are cubes of `edge_m` counted from the world's origin, so that neighbouring tiles agree on them.
/// Ties go to the smaller coordinates; the result is sorted by voxel (z, then y, then x) and does not depend
/// on the order of the points.
pub fn thin_to_voxels(points: &[Point3<f64>], edge_m: f64) -> Vec<usize> {
    let mut nearest: CellMap<[i64; 3], (f64, usize)> = CellMap::default();
    for (i, p) in points.iter().enumerate() {
        let cell = [2, 1, 0].map(|a| floor(p[a] / edge_m));
        let [z, y, x] = cell.map(|c| c as f64 + 0.5);
        let found = ((p - Point3::new(x, y, z) * edge_m).norm_squared(), i);
        let kept = nearest.entry(cell).or_insert(found);
        if is_before(&found, kept, points) {
            *kept = found;
        }
    }
    let mut kept: Vec<([i64; 3], usize)> = nearest.into_iter().map(|(cell, (_, i))| (cell, i)).collect();
    kept.sort_unstable();
    kept.into_iter().map(|(_, i)| i).collect()
}

/// Whether a point, with its squared distance to the middle, goes before another.
fn is_before(a: &(f64, usize), b: &(f64, usize), points: &[Point3<f64>]) -> bool {
    a.0.total_cmp(&b.0)
        .then_with(|| lexicographic(&points[a.1], &points[b.1]))
        .then(a.1.cmp(&b.1))
        .is_lt()
}

fn lexicographic(a: &Point3<f64>, b: &Point3<f64>) -> std::cmp::Ordering {
    (0..3)
        .map(|i| a[i].total_cmp(&b[i]))
        .find(|o| o.is_ne())
        .unwrap_or(std::cmp::Ordering::Equal)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_voxel_keeps_its_most_central_point_in_any_order() {
        let mut points: Vec<_> = (0..400)
            .map(|i| Point3::new(0.013 * f64::from(i % 20) - 0.1, 0.017 * f64::from(i / 20), 5e6))
            .collect();
        let kept: Vec<_> = thin_to_voxels(&points, 0.05)
            .into_iter()
            .map(|i| points[i])
            .collect();
        // x from -0.1 to 0.147 touches 5 voxels, y from 0 to 0.323 touches 7.
        assert_eq!(kept.len(), 35);
        points.reverse();
        let reversed: Vec<_> = thin_to_voxels(&points, 0.05)
            .into_iter()
            .map(|i| points[i])
            .collect();
        assert_eq!(kept, reversed);
        assert!(thin_to_voxels(&[], 0.05).is_empty());
    }
}
