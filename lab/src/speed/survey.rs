//! Two clouds of a wall, compared in each way.

use nalgebra::{Point3, Vector3};
use std::path::Path;
use stonewise_core::change::{CorePoint, M3c2Params, OutwardReference, c2c, m3c2};
use stonewise_core::cloud::{Cloud, GridIndex};
use stonewise_core::id::StoneId;
use stonewise_core::registration::{GicpBlock, GicpParams, GicpStone, align};

/// Half width and half height of a stone, metres.
const STONE_M: [f64; 2] = [0.15, 0.10];
/// Everything within this distance of a stone takes part, metres: that of the paper.
const BUFFER_M: f64 = 0.6;
/// More than that is needed around the windows, metres: half a stone and the reach of correspondences.
const MARGIN_M: f64 = 0.3;
/// Distances beyond this are not sought, metres.
const C2C_MAX_M: f64 = 0.5;

/// The input of all cases.
pub struct Survey {
    pub clouds: [Vec<Point3<f64>>; 2],
    core: Vec<Point3<f64>>,
    windows: Windows,
}

/// The stones with their surroundings in both epochs.
struct Windows {
    near: [Cloud; 2],
    stones: Vec<GicpStone>,
}

impl Survey {
    pub fn read(folder: &Path) -> Self {
        let clouds = ["first.f64", "second.f64"].map(|name| points(&folder.join(name)));
        let windows = Windows::new(&clouds, &points(&folder.join("stones.f64")));
        Self {
            clouds,
            core: points(&folder.join("core.f64")),
            windows,
        }
    }

    /// Distances from the second to the first cloud; the index included.
    pub fn c2c(&self) -> (usize, Vec<f64>) {
        let index = GridIndex::for_nearest(&self.clouds[0]);
        let distances = c2c(&index, &self.clouds[1], C2C_MAX_M);
        (
            distances.len(),
            distances.iter().map(|d| d.unwrap_or(f64::NAN)).collect(),
        )
    }

    /// Normals and distances at the core points; the indices included. Distance, limit, and normal of each.
    pub fn m3c2(&self) -> (usize, Vec<f64>) {
        let params = M3c2Params::default();
        let [first, second] = [0, 1].map(|e| GridIndex::new(&self.clouds[e], params.cylinder_radius_m));
        let outward = OutwardReference::Direction(-Vector3::y());
        let core = CorePoint::fitted(&first, &self.core, params.normal_radius_m, &outward);
        let field = m3c2(&first, &second, &core, &params);
        let values = field.points.iter().flat_map(|p| {
            [
                p.distance_m.unwrap_or(f64::NAN),
                p.detection_limit_m.unwrap_or(f64::NAN),
                p.normal.x,
                p.normal.y,
                p.normal.z,
            ]
        });
        (field.points.len(), values.collect())
    }

    /// The stones by the paper's estimator, with everything within 60 cm; what all share included.
    /// Displacement, standard deviation along each axis.
    pub fn gicp(&self, voxel_m: f64) -> (usize, Vec<f64>) {
        let params = GicpParams {
            buffer_m: BUFFER_M,
            voxel_m,
            ..GicpParams::default()
        };
        let Windows { near, stones } = &self.windows;
        let [first, second] = [0, 1].map(|e| GicpBlock::new(&near[e], &params));
        let results = align(&first, &second, stones, &params);
        let values = results.iter().flat_map(|r| {
            let motion = r.motion.as_ref().unwrap();
            let [dx, dy, dz] = motion.displacement.into();
            let sd = |a: usize| motion.covariance[(a, a)].sqrt();
            [dx, dy, dz, sd(0), sd(1), sd(2)]
        });
        (stones.len(), values.collect())
    }
}

impl Windows {
    fn new(clouds: &[Vec<Point3<f64>>; 2], centres: &[Point3<f64>]) -> Self {
        let reach = BUFFER_M + MARGIN_M;
        let sum: Vector3<f64> = centres.iter().map(|s| s.coords).sum();
        let middle = Point3::from(sum / centres.len().max(1) as f64);
        let near = [0, 1].map(|e| {
            let is_near = |p: &&Point3<f64>| centres.iter().any(|s| (*p - s).amax() < reach);
            Cloud::from_world(middle, clouds[e].iter().filter(is_near).copied())
        });
        let stone = |(id, &centroid): (u32, &Point3<f64>)| GicpStone {
            first: StoneId(id),
            second: StoneId(id),
            centroid,
            points: indices(&near[0], &centroid),
            points_second: indices(&near[1], &centroid).len(),
        };
        let stones = (1..).zip(centres).map(stone).collect();
        Self { near, stones }
    }
}

fn points(path: &Path) -> Vec<Point3<f64>> {
    let bytes = std::fs::read(path).unwrap();
    let values: Vec<f64> = bytes
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes(b.try_into().unwrap()))
        .collect();
    values
        .chunks_exact(3)
        .map(|p| Point3::new(p[0], p[1], p[2]))
        .collect()
}

/// Points of the stone around a centre.
fn indices(cloud: &Cloud, centre: &Point3<f64>) -> Vec<u32> {
    let inside = |p: Point3<f64>| (p.x - centre.x).abs() < STONE_M[0] && (p.z - centre.z).abs() < STONE_M[1];
    (0..cloud.len() as u32)
        .filter(|&i| inside(cloud.world(i as usize)))
        .collect()
}
