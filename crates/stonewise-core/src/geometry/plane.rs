//! Planes through points.

use crate::geometry::Moments;
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

/// Points less wide than this part of their length lie on a line: what rounding leaves where products are
/// summed about the mean.
const LEAST_WIDTH: f64 = 1e-12;
/// The least width where products are summed about another point: the root of the rounding error.
const LEAST_WIDTH_OF_MOMENTS: f64 = 1e-7;

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
        Self::of_covariance(centroid, covariance, LEAST_WIDTH)
    }

    /// The least-squares plane from sums about `base`, which must lie among the points or near them: digits are lost
    /// with the square of its distance. `None` under three points or on a line.
    pub fn of_moments(base: &Point3<f64>, moments: &Moments) -> Option<Self> {
        if moments.count < 3.0 {
            return None;
        }
        let centroid = base + moments.sum / moments.count;
        Self::of_covariance(centroid, moments.covariance(), LEAST_WIDTH_OF_MOMENTS)
    }

    fn of_covariance(centroid: Point3<f64>, covariance: Matrix3<f64>, least_width: f64) -> Option<Self> {
        let eigen = covariance.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let spread_m = order.map(|i| eigen.eigenvalues[i].max(0.0).sqrt());
        if spread_m[1] <= least_width * spread_m[2].max(1e-300) || spread_m[2] == 0.0 {
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

    fn of_moments(points: &[Point3<f64>], base: &Point3<f64>) -> Option<Plane> {
        let mut moments = Moments::default();
        points.iter().for_each(|p| moments.add(&(p - base)));
        Plane::of_moments(base, &moments)
    }

    #[test]
    fn points_on_a_line_have_no_plane() {
        let points: Vec<_> = (0..9).map(|i| Point3::new(f64::from(i), 0.0, 0.0)).collect();
        assert!(Plane::fit(&points).is_none());
        let slanted: Vec<_> = points
            .iter()
            .map(|p| Point3::new(0.3 * p.x, 0.7 * p.x, 0.1 * p.x))
            .collect();
        assert!(of_moments(&slanted, &slanted[2]).is_none());
    }

    #[test]
    fn sums_give_the_plane_that_two_passes_give() {
        let wave = |i: usize| {
            let (a, b) = (0.01 * (i % 50) as f64, 0.01 * (i / 50) as f64);
            Point3::new(a, 0.3 * a + 0.01 * (17.0 * a + 5.0 * b).sin(), b)
        };
        let points: Vec<_> = (0..2500).map(wave).collect();
        let two_passes = Plane::fit(&points).unwrap();
        for base in [points[0], points[1275], Point3::new(0.2, 0.1, 0.3)] {
            let sums = of_moments(&points, &base).unwrap();
            assert!(sums.normal.cross(&two_passes.normal).norm() < 1e-14);
            assert!((sums.centroid - two_passes.centroid).norm() < 1e-14);
            for (a, b) in sums.spread_m.iter().zip(two_passes.spread_m) {
                assert!((a - b).abs() < 1e-14);
            }
        }
    }
}
