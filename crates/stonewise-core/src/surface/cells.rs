//! Planar pieces of a cloud.

use crate::cloud::{Cloud, TileSource};
use crate::geometry::{Moments, Plane, cell_of};
use crate::progress::{Interrupted, Progress};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Fewest points of a cell that is a surface.
const LEAST_POINTS: usize = 12;
/// Largest thickness of a surface cell as a part of its width (standard deviations): rubble of 10 cm relief in
/// a cell of half a metre has 0.15; foliage and corners have more.
const MOST_THICKNESS: f64 = 0.3;

/// A piece of a surface: the points of a cubic cell that lie about a plane.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceCell {
    /// Which cell of the grid, by its lowest corner in cells.
    pub cell: [i64; 3],
    /// Mean of the points, world frame, metres.
    pub centroid: Point3<f64>,
    /// Unit normal; its sign is arbitrary until the cells are oriented.
    pub normal: Vector3<f64>,
    /// Mean distance between neighbouring points, metres: root of the area of a point.
    pub spacing_m: f64,
    /// Skewness of the heights above the plane along `normal`, dimensionless. Joints lie behind the faces of
    /// stones, so that masonry has negative skewness along its outward normal.
    pub skewness: f64,
}

impl SurfaceCell {
    /// The cell seen from the other side.
    pub fn flipped(self) -> Self {
        Self {
            normal: -self.normal,
            skewness: -self.skewness,
            ..self
        }
    }

    fn of(cell: [i64; 3], cloud: &Cloud, points: &[u32]) -> Option<Self> {
        if points.len() < LEAST_POINTS {
            return None;
        }
        let base = cloud.local(points[0] as usize);
        let mut moments = Moments::default();
        for &i in points {
            moments.add(&(cloud.local(i as usize) - base));
        }
        let plane = Plane::of_moments(&base, &moments)?;
        let [thin, narrow, wide] = plane.spread_m;

        // Points along a line are an edge or a cable.
        if thin > MOST_THICKNESS * narrow || narrow < 0.2 * wide {
            return None;
        }
        let count = points.len() as f64;
        let third: f64 = points
            .iter()
            .map(|&i| {
                (cloud.local(i as usize) - plane.centroid)
                    .dot(&plane.normal)
                    .powi(3)
            })
            .sum();

        // An evenly covered rectangle has variances of a twelfth of the squares of its sides.
        let area_m2 = 12.0 * narrow * wide;
        Some(Self {
            cell,
            centroid: cloud.origin() + plane.centroid.coords,
            normal: plane.normal,
            spacing_m: (area_m2 / count).sqrt(),
            skewness: if thin > 0.0 {
                third / count / thin.powi(3)
            } else {
                0.0
            },
        })
    }
}

/// The surface cells of a cloud with an edge of `cell_m` metres, tile by tile, in a fixed order. A cell that a
/// border of tiles divides counts once in each tile.
///
/// # Errors
/// A tile cannot be read, interruption.
pub fn surface_cells<T: TileSource, E: From<T::Error> + From<Interrupted>>(
    tiles: &T,
    cell_m: f64,
    progress: &dyn Progress,
) -> Result<Vec<SurfaceCell>, E> {
    let mut found = Vec::new();
    progress.begin("surface of the cloud", tiles.tile_count() as u64);
    for tile in 0..tiles.tile_count() {
        progress.check()?;
        let cloud = tiles.load(tile)?;
        let mut members: BTreeMap<[i64; 3], Vec<u32>> = BTreeMap::new();
        for i in 0..cloud.len() {
            members
                .entry(cell_of(&cloud.world(i), cell_m))
                .or_default()
                .push(i as u32);
        }
        let members: Vec<_> = members.into_iter().collect();
        let of_tile: Vec<Option<SurfaceCell>> = members
            .par_iter()
            .map(|(cell, points)| SurfaceCell::of(*cell, &cloud, points))
            .collect();
        found.extend(of_tile.into_iter().flatten());
        progress.advance(1);
    }
    Ok(found)
}
