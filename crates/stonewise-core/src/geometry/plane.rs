//! Planes through points.

use nalgebra::{Matrix3, Point3, Vector3};

/// A least-squares plane with the spread of its points.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// Mean of the points.
    pub centroid: Point3<f64>,
    /// Unit normal, sign arbitrary.
    pub normal: Vector3<f64>,
    /// Standard deviations of the points along the three principal axes, smallest first, metres (ddof 0).
    pub spread_m: [f64; 3],
}

impl Plane {
    /// The plane that minimises squared orthogonal distances; `None` under three points or on a line.
    pub fn fit(points: &[Point3<f64>]) -> Option<Self> {
        if points.len() < 3 {
            return None;
        }
        let n = points.len() as f64;
        // Sums about the first point, so that projected coordinates of millions of metres lose nothing.
        let base = points[0];
        let mean: Vector3<f64> = points.iter().map(|p| p - base).sum::<Vector3<f64>>() / n;
        let centroid = base + mean;
        let mut covariance = Matrix3::zeros();
        for p in points {
            let q = p - centroid;
            covariance += q * q.transpose() / n;
        }
        let eigen = covariance.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let spread_m = order.map(|i| eigen.eigenvalues[i].max(0.0).sqrt());
        if spread_m[1] <= 1e-12 * spread_m[2].max(1e-300) || spread_m[2] == 0.0 {
            return None;
        }
        Some(Self {
            centroid,
            normal: eigen.eigenvectors.column(order[0]).normalize(),
            spread_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_a_tilted_plane_far_from_the_origin() {
        let normal = Vector3::new(0.9, 0.1, 0.3).normalize();
        let u = normal.cross(&Vector3::z()).normalize();
        let v = normal.cross(&u);
        let origin = Point3::new(4.5e5, 5.6e6, 300.0);
        let points: Vec<_> = (0..100)
            .map(|i| origin + u * (0.1 * f64::from(i % 10)) + v * (0.07 * f64::from(i / 10)))
            .collect();
        let plane = Plane::fit(&points).unwrap();
        assert!(plane.normal.cross(&normal).norm() < 1e-6);
        assert!(plane.spread_m[0] < 1e-8);
        assert!((plane.spread_m[2] - 0.1 * (99.0f64 / 12.0).sqrt()).abs() < 1e-6);
    }

    #[test]
    fn points_on_a_line_have_no_plane() {
        let points: Vec<_> = (0..9).map(|i| Point3::new(f64::from(i), 0.0, 0.0)).collect();
        assert!(Plane::fit(&points).is_none());
    }
}
