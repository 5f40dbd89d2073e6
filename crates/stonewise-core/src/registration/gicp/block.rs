//! A region of an epoch, prepared once for all stones inside.

use super::normal::{FAR_M, PlaneFit};
use super::params::GicpParams;
use crate::cloud::{Cloud, GridIndex};
use crate::geometry::{CellMap, cell_of};
use crate::statistics::{split_mix, upper_median};
use nalgebra::{Point3, Vector3};
use std::sync::OnceLock;

/// Points of a region with their search index and planes.
///
/// A covariance regularised to a plane is `I - (1 - epsilon) n n'`, so the unit normal `n` says it all.
pub struct GicpBlock {
    /// World position of the local origin.
    pub(super) origin: Point3<f64>,
    /// Relative to the origin.
    pub(super) points: Vec<Point3<f64>>,
    /// Filled for the points that take part.
    normals: Vec<OnceLock<Vector3<f64>>>,
    planes: PlaneFit,
    pub(super) index: GridIndex,
    /// The point that stands for each point of the cloud, where the cloud is thinned.
    merged: Option<Vec<u32>>,
    /// Typical distance of neighbouring points, metres.
    pub(super) spacing_m: f64,
}

/// Points whose distance to their neighbour gives the spacing: its median is then known to some percent.
const SPACING_SAMPLE: usize = 500;

impl GicpBlock {
    /// Prepares the points of a region, thinned to [`GicpParams::voxel_m`].
    ///
    /// Cost: one index, and later one search for `plane_neighbours` neighbours of each point that takes part;
    /// about 110 bytes a point.
    pub fn new(cloud: &Cloud, params: &GicpParams) -> Self {
        let (points, merged) = if params.voxel_m > 0.0 {
            let (points, merged) = thinned(cloud, params.voxel_m);
            (points, Some(merged))
        } else {
            ((0..cloud.len()).map(|i| cloud.local(i)).collect(), None)
        };
        let spacing_m = spacing(&points);
        let index = GridIndex::new(&points, 2.0 * spacing_m);
        Self {
            origin: cloud.origin(),
            normals: vec![OnceLock::new(); points.len()],
            points,
            planes: PlaneFit::new(spacing_m, params),
            index,
            merged,
            spacing_m,
        }
    }

    /// Unit normal of the plane at a point; its sign is arbitrary. Fitted at the first call.
    #[inline]
    pub(super) fn normal(&self, point: usize) -> Vector3<f64> {
        let fit = || self.planes.normal(&self.index, &self.points[point]);
        *self.normals[point].get_or_init(fit)
    }

    /// The points that stand for some points of the cloud, which indices name; each once.
    pub(super) fn standing_for(&self, cloud: &[u32]) -> Vec<u32> {
        let Some(merged) = &self.merged else {
            return cloud.to_vec();
        };
        let mut standing: Vec<u32> = cloud.iter().map(|&i| merged[i as usize]).collect();
        standing.sort_unstable();
        standing.dedup();
        standing
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

/// One point of each voxel of a world-aligned grid, in the order of the voxels' first points, and which of
/// them stands for each point.
///
/// Which point stays is drawn by a hash of its position. Means of voxels, or the points nearest to their
/// middles, would lie on the same lattice in both epochs and hold the motion back, by 0.15 of 4 mm at voxels
/// of 1 cm.
fn thinned(cloud: &Cloud, voxel_m: f64) -> (Vec<Point3<f64>>, Vec<u32>) {
    let mut numbers: CellMap<[i64; 3], u32> = CellMap::default();
    let mut kept: Vec<(u64, usize)> = Vec::new();
    let mut merged = Vec::with_capacity(cloud.len());
    for (i, offset) in cloud.offsets().iter().enumerate() {
        let draw = (
            offset
                .iter()
                .fold(0, |hash, c| split_mix(hash ^ u64::from(c.to_bits()))),
            i,
        );
        let number = *numbers
            .entry(cell_of(&cloud.world(i), voxel_m))
            .or_insert_with(|| {
                kept.push(draw);
                kept.len() as u32 - 1
            });
        let least = &mut kept[number as usize];
        *least = draw.min(*least);
        merged.push(number);
    }
    (kept.iter().map(|(_, i)| cloud.local(*i)).collect(), merged)
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
