//! A region of an epoch, prepared once for all stones inside.

use super::params::GicpParams;
use crate::cloud::{Cloud, GridIndex};
use crate::geometry::{CellMap, Moments, cell_of};
use crate::id::StoneId;
use crate::statistics::split_mix;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// A matched stone inside a pair of blocks.
#[derive(Clone, Debug)]
pub struct GicpStone {
    /// Stone of the first epoch.
    pub first: StoneId,
    /// Its partner in the second.
    pub second: StoneId,
    /// Centroid in the first epoch, world frame; the displacement is reported here.
    pub centroid: Point3<f64>,
    /// The stone's points, as indices into the cloud of the first block.
    pub points: Vec<u32>,
    /// Number of the partner's points.
    pub points_second: usize,
}

/// Neighbours are sought no farther than this, metres: no survey of stones has its points that far apart.
const FAR_M: f64 = 1.0;

/// Points of a region with their search index and planes.
///
/// A covariance regularised to a plane is `I - (1 - epsilon) n n'`, so the unit normal `n` says it all.
pub struct GicpBlock {
    /// World position of the local origin.
    pub(super) origin: Point3<f64>,
    /// Relative to the origin.
    pub(super) points: Vec<Point3<f64>>,
    /// Unit normals of the planes at the points, signs arbitrary.
    pub(super) normals: Vec<Vector3<f64>>,
    pub(super) index: GridIndex,
    /// Which points of the cloud these are, ascending.
    pub(super) kept: Vec<u32>,
}

impl GicpBlock {
    /// Prepares the points of a region, thinned to [`GicpParams::voxel_m`].
    ///
    /// Cost: one index, and one search for `plane_neighbours` neighbours of each point; about 70 bytes a point.
    pub fn new(cloud: &Cloud, params: &GicpParams) -> Self {
        let kept = match params.voxel_m > 0.0 {
            true => thinned(cloud, params.voxel_m),
            false => (0..cloud.len() as u32).collect(),
        };
        let points: Vec<Point3<f64>> = kept.iter().map(|&i| cloud.local(i as usize)).collect();
        let index = GridIndex::for_nearest(&points);
        let normal = |p: &Point3<f64>| {
            let mut moments = Moments::default();
            for (i, _) in index.nearest_k(p, params.plane_neighbours, FAR_M) {
                moments.add(&(points[i] - p));
            }
            let eigen = moments.covariance().symmetric_eigen();
            eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned()
        };
        Self {
            origin: cloud.origin(),
            normals: points.par_iter().map(normal).collect(),
            points,
            index,
            kept,
        }
    }
}

/// One point of each voxel of a world-aligned grid, ascending.
///
/// Which point stays is drawn by a hash of its position. Means of voxels, or the points nearest to their
/// middles, would lie on the same lattice in both epochs and hold the motion back, by 0.15 of 4 mm at voxels
/// of 1 cm.
fn thinned(cloud: &Cloud, voxel_m: f64) -> Vec<u32> {
    let mut least: CellMap<[i64; 3], (u64, u32)> = CellMap::default();
    for (i, offset) in cloud.offsets().iter().enumerate() {
        let mixed = |hash, c: &f32| split_mix(hash ^ u64::from(c.to_bits()));
        let draw = (offset.iter().fold(0, mixed), i as u32);
        let held = least.entry(cell_of(&cloud.world(i), voxel_m)).or_insert(draw);
        *held = draw.min(*held);
    }
    let mut kept: Vec<u32> = least.into_values().map(|(_, i)| i).collect();
    kept.sort_unstable();
    kept
}
