//! The outside of a surface at any place.

use super::SurfaceCell;
use crate::cloud::GridIndex;
use nalgebra::{Point3, Vector3};

/// Nearest cells whose normals are compared with one at a place: at an edge, one of them is parallel to it.
const COMPARED: usize = 8;

/// The side of a surface that is outside, for normals anywhere on it.
pub struct Outside {
    index: GridIndex,
    normals: Vec<Vector3<f64>>,
}

impl Outside {
    /// The outside of a surface of cells whose normals point outside.
    pub fn of(cells: &[SurfaceCell]) -> Self {
        let centroids: Vec<Point3<f64>> = cells.iter().map(|c| c.centroid).collect();
        Self {
            index: GridIndex::for_nearest(&centroids),
            normals: cells.iter().map(|c| c.normal).collect(),
        }
    }

    /// The normal or its opposite, as the most parallel of the nearest cells points; unchanged without cells.
    pub fn orient(&self, at: &Point3<f64>, normal: Vector3<f64>) -> Vector3<f64> {
        let nearest = self.index.nearest_k(at, COMPARED, f64::INFINITY);
        let cosines = nearest.iter().map(|(cell, _)| self.normals[*cell].dot(&normal));
        let most_parallel = cosines.max_by(|a, b| a.abs().total_cmp(&b.abs()));
        match most_parallel {
            Some(cosine) if cosine < 0.0 => -normal,
            _ => normal,
        }
    }
}
