//! The wall's face around a stone, without the stones' own bumps.

use super::islands::Voxel;
use crate::geometry::{Plane, cell_of, cells_between};
use crate::statistics::upper_median;
use nalgebra::{Matrix3, Point3, Vector3};
use std::collections::HashMap;

/// Side of the cells whose mean points stand for the face, metres: many a stone, so that a plane through them
/// does not depend on the density of the cloud.
const CELL_M: f64 = 0.1;
/// Fewer cells do not make a face.
const MIN_CELLS: usize = 6;
/// Reweighted fits of the plane.
const ITERATIONS: usize = 8;
/// Tukey's biweight gives nothing to points beyond this many standard deviations (95 % efficiency: 4.685).
const TUKEY: f64 = 4.685;

/// Mean points of the stones in a coarse grid over the whole wall.
pub(super) struct FaceCells {
    cells: HashMap<Voxel, (u32, Vector3<f64>)>,
}

impl FaceCells {
    pub(super) fn new() -> Self {
        Self {
            cells: HashMap::new(),
        }
    }

    /// Adds a point of a stone.
    pub(super) fn add(&mut self, world: &Point3<f64>) {
        let voxel = cell_of(world, CELL_M);
        let (count, sum) = self.cells.entry(voxel).or_insert((0, Vector3::zeros()));
        *count += 1;
        *sum += world - corner(voxel);
    }

    /// Unit normal of the face within `radius_m` of a place, sign arbitrary; `None` where too little of it is
    /// known.
    ///
    /// A plane by iteratively reweighted least squares with Tukey's biweight (Beaton & Tukey 1974).
    pub(super) fn normal(&self, centre: &Point3<f64>, radius_m: f64) -> Option<Vector3<f64>> {
        let points = self.within(centre, radius_m);
        if points.len() < MIN_CELLS {
            return None;
        }
        let mut plane = Plane::fit(&points)?;
        for _ in 0..ITERATIONS {
            let residual = |p: &Point3<f64>| (p - plane.centroid).dot(&plane.normal);
            let mut sizes: Vec<f64> = points.iter().map(|p| residual(p).abs()).collect();
            let sigma = (1.4826 * upper_median(&mut sizes)?).max(1e-4);
            let weights: Vec<f64> = points
                .iter()
                .map(|p| (1.0 - (residual(p) / (TUKEY * sigma)).powi(2)).max(0.0).powi(2))
                .collect();
            let Some((centroid, normal)) = weighted_plane(&points, &weights) else {
                break;
            };
            plane.centroid = centroid;
            plane.normal = normal;
        }
        Some(plane.normal)
    }

    /// Mean points of the cells within a radius, in the order of the grid.
    fn within(&self, centre: &Point3<f64>, radius_m: f64) -> Vec<Point3<f64>> {
        let low = cell_of(&centre.map(|c| c - radius_m), CELL_M);
        let high = cell_of(&centre.map(|c| c + radius_m), CELL_M);
        let mut found = Vec::new();
        for cell in cells_between(low, high) {
            let Some((count, sum)) = self.cells.get(&cell) else {
                continue;
            };
            let mean = corner(cell) + sum / f64::from(*count);
            if (mean - centre).norm() <= radius_m {
                found.push(mean);
            }
        }
        found
    }
}

fn corner(voxel: Voxel) -> Point3<f64> {
    Point3::from(voxel.map(|c| c as f64 * CELL_M))
}

fn weighted_plane(points: &[Point3<f64>], weights: &[f64]) -> Option<(Point3<f64>, Vector3<f64>)> {
    let total: f64 = weights.iter().sum();
    if total < 3.0 {
        return None;
    }
    let base = points[0];
    let mean = points
        .iter()
        .zip(weights)
        .map(|(p, w)| (p - base) * *w)
        .sum::<Vector3<f64>>()
        / total;
    let centroid = base + mean;
    let moments: Matrix3<f64> = points
        .iter()
        .zip(weights)
        .map(|(p, w)| (p - centroid) * (p - centroid).transpose() * *w)
        .sum();
    let eigen = moments.symmetric_eigen();
    Some((
        centroid,
        eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned(),
    ))
}
