//! A region of an epoch, prepared once for all stones inside.

use super::params::GicpParams;
use crate::cloud::{Cloud, GridIndex};
use crate::statistics::upper_median;
use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

/// Points of a region with their search index and planes.
///
/// A covariance regularised to a plane is `I - (1 - epsilon) n n'`, so the unit normal `n` says it all.
pub struct GicpBlock {
    /// World position of the local origin.
    pub(super) origin: Point3<f64>,
    /// Relative to the origin.
    pub(super) points: Vec<Point3<f64>>,
    /// Unit normals; their sign is of no meaning.
    pub(super) normals: Vec<Vector3<f64>>,
    pub(super) index: GridIndex,
    /// Typical distance of neighbouring points, metres.
    pub(super) spacing_m: f64,
}

/// Points whose distance to their neighbour gives the spacing: its median is then known to some percent.
const SPACING_SAMPLE: usize = 500;
/// Neighbours are sought no farther than this, metres: no survey of stones has its points that far apart.
const FAR_M: f64 = 1.0;

impl GicpBlock {
    /// Prepares the points of a region: one index, one plane a point.
    ///
    /// Cost: one search for `plane_neighbours` neighbours a point; about 100 bytes a point.
    pub fn new(cloud: &Cloud, params: &GicpParams) -> Self {
        let points: Vec<Point3<f64>> = (0..cloud.len()).map(|i| cloud.local(i)).collect();
        let spacing_m = spacing(&points);
        let index = GridIndex::new(&points, 2.0 * spacing_m);
        let normals = points.par_iter().map(|p| normal(&index, p, params)).collect();
        Self {
            origin: cloud.origin(),
            points,
            normals,
            index,
            spacing_m,
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

/// Median distance to the nearest neighbour, doubled: that of an even grid of random points.
fn spacing(points: &[Point3<f64>]) -> f64 {
    let Some(bounds) = crate::geometry::Bounds::of(points.iter().copied()) else {
        return FAR_M;
    };
    let extent = (bounds.max - bounds.min).norm();
    let index = GridIndex::new(points, (extent / (points.len() as f64).sqrt()).max(1e-4));
    let stride = points.len().div_ceil(SPACING_SAMPLE);
    let mut nearest: Vec<f64> = points
        .iter()
        .step_by(stride)
        .filter_map(|p| index.nearest_k(p, 2, FAR_M).get(1).map(|n| n.1.sqrt()))
        .collect();
    upper_median(&mut nearest).map_or(FAR_M, |d| (2.0 * d).max(1e-4))
}

/// Normal of the plane through the neighbours of a point.
fn normal(index: &GridIndex, p: &Point3<f64>, params: &GicpParams) -> Vector3<f64> {
    let nearest = index.nearest_k(p, params.plane_neighbours, FAR_M);
    let reach = nearest.last().map_or(0.0, |n| n.1.sqrt());
    let (mut n, mut sum, mut square) = (0.0, Vector3::zeros(), Matrix3::zeros());
    index.positions_within(p, reach.max(params.plane_radius_m), |_, q| {
        let d = q - p;
        n += 1.0;
        sum += d;
        square += d * d.transpose();
    });
    let spread = (square - sum * sum.transpose() / n) / n;
    let eigen = spread.symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    eigen.eigenvectors.column(least).into_owned()
}
