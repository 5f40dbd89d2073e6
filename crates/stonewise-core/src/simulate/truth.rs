//! What is true of every simulated stone, and how much of it the surveys saw.

use crate::evaluate::TrueStone;
use crate::id::StoneId;
use crate::raster::LabelImage;
use crate::simulate::scan::Scan;
use crate::simulate::scene::{Scene, Target};
use crate::simulate::survey::World;
use nalgebra::{Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet};

/// A stone with its true motion.
#[derive(Clone, Debug, PartialEq)]
pub struct StoneTruth {
    /// Number in the wall.
    pub id: StoneId,
    /// Mean of its face in epoch 1 as seen square on, world frame.
    pub centroid: Point3<f64>,
    /// Its middle on the face: along and up, metres.
    pub middle: [f64; 2],
    /// Area of its face as seen square on, m^2.
    pub area_m2: f64,
    /// Width and height on the face, metres.
    pub size_m: [f64; 2],
    /// Displacement of the centroid, world frame, metres.
    pub displacement: Vector3<f64>,
    /// Rotation vector, radians.
    pub rotation: Vector3<f64>,
    /// Motion that it shares with its neighbours, world frame, metres.
    pub shared: Vector3<f64>,
    /// Moves on its own.
    pub loose: bool,
    /// Cut by the end of the section, the crown or the ground.
    pub edge: bool,
    /// Outward normal of the face.
    pub normal: Vector3<f64>,
    /// Cells of its face, for [`seen_share`], as places in its own frame.
    cells: BTreeSet<[i32; 2]>,
}

/// Cells in which visibility is counted, metres: several points of the coarsest scan each.
const CELL_M: f64 = 0.025;
/// Step of the raster on the face from which cells, areas and centroids are taken, metres.
const STEP_M: f64 = 0.006;

/// The truth of all stones, in the wall's order. Cost: about 30,000 rays a square metre.
pub fn stone_truths(world: &World) -> Vec<StoneTruth> {
    let faces = face_samples(&world.scene(0));
    let wall = &world.wall;
    let measure = |(stone, motion): (&super::SimStone, &super::TrueMotion)| {
        let samples = faces.get(&stone.id.0).map_or(&[][..], Vec::as_slice);
        let mean =
            samples.iter().fold(Vector3::zeros(), |s, (p, _)| s + p.coords) / samples.len().max(1) as f64;
        let centroid = if samples.is_empty() {
            stone.world_from_stone.translation.vector.into()
        } else {
            Point3::from(mean)
        };
        StoneTruth {
            id: stone.id,
            centroid,
            middle: stone.middle,
            area_m2: samples.len() as f64 * STEP_M * STEP_M,
            size_m: [
                stone.bounds[1] - stone.bounds[0],
                stone.bounds[3] - stone.bounds[2],
            ],
            displacement: motion.second_from_first * centroid - centroid,
            rotation: motion.second_from_first.rotation.scaled_axis(),
            shared: motion.shared,
            loose: motion.loose,
            edge: stone.edge,
            normal: wall.face.frame(stone.middle[0]).out,
            cells: samples.iter().map(|(_, at)| cell(*at)).collect(),
        }
    };
    wall.stones.iter().zip(&world.motions).map(measure).collect()
}

/// Share of each stone's face that a scan measured, 0..1, in the wall's order. `epoch`: 0 or 1, that of the scan.
pub fn seen_share(world: &World, truths: &[StoneTruth], scan: &Scan, epoch: usize) -> Vec<f64> {
    let mut hit: Vec<BTreeSet<[i32; 2]>> = vec![BTreeSet::new(); truths.len()];
    let to_stone: Vec<_> = world
        .wall
        .stones
        .iter()
        .zip(&world.motions)
        .map(|(stone, motion)| {
            let pose = if epoch == 0 {
                stone.world_from_stone
            } else {
                motion.second_from_first * stone.world_from_stone
            };
            pose.inverse()
        })
        .collect();
    for (i, &stone) in scan.stone.iter().enumerate().filter(|(_, s)| **s > 0) {
        let stone = stone as usize - 1;
        let exact = scan.cloud.origin() + Vector3::from(scan.exact[i]).cast::<f64>();
        let local = to_stone[stone] * exact;
        let cell = cell([local.x, local.y]);
        if truths[stone].cells.contains(&cell) {
            hit[stone].insert(cell);
        }
    }
    let share = |(t, h): (&StoneTruth, BTreeSet<_>)| h.len() as f64 / t.cells.len().max(1) as f64;
    truths.iter().zip(hit).map(share).collect()
}

/// Points of each stone in a scan, in the wall's order.
pub fn point_counts(scan: &Scan, stones: usize) -> Vec<u32> {
    let mut counts = vec![0; stones];
    for &stone in scan.stone.iter().filter(|s| **s > 0) {
        counts[stone as usize - 1] += 1;
    }
    counts
}

/// Number of photos that show at least `pixels` pixels of each stone, in the wall's order.
pub fn photo_counts<'a>(
    labels: impl IntoIterator<Item = &'a LabelImage>,
    stones: usize,
    pixels: u32,
) -> Vec<u32> {
    let mut photos = vec![0; stones];
    for image in labels {
        let mut counts = vec![0u32; stones + 1];
        for &label in image.data() {
            counts[label as usize] += 1;
        }
        for (photo, &count) in photos.iter_mut().zip(&counts[1..]) {
            *photo += u32::from(count >= pixels);
        }
    }
    photos
}

impl StoneTruth {
    /// The form in which results are scored. `visible_share`: of its face, measured in both epochs.
    pub fn to_true_stone(&self, visible_share: f64) -> TrueStone {
        TrueStone {
            stone_id: self.id.0,
            centroid: self.centroid,
            normal: self.normal,
            displacement: self.displacement,
            rotation: self.rotation,
            loose: self.loose,
            edge: self.edge,
            visible_share,
        }
    }
}

fn cell(at: [f64; 2]) -> [i32; 2] {
    at.map(|v| (v / CELL_M).floor() as i32)
}

/// A point of a stone's face, in the world and in the stone's frame.
type FaceSample = (Point3<f64>, [f64; 2]);

/// Points of each stone's face on a square raster.
fn face_samples(scene: &Scene) -> BTreeMap<u32, Vec<FaceSample>> {
    use rayon::prelude::*;
    let w = scene.window();
    let steps = [0, 2].map(|i| ((w[i + 1] - w[i]) / STEP_M) as usize);
    let rows: Vec<Vec<_>> = (0..steps[1])
        .into_par_iter()
        .map(|j| {
            let u = w[2] + (j as f64 + 0.5) * STEP_M;
            let sample = |i: usize| {
                let hit = scene.on_face(w[0] + (i as f64 + 0.5) * STEP_M, u)?;
                match hit.target {
                    Target::Stone(k, at) => Some((k as u32 + 1, (hit.point, at))),
                    Target::Other(..) => None,
                }
            };
            (0..steps[0]).filter_map(sample).collect()
        })
        .collect();
    let mut faces: BTreeMap<u32, Vec<_>> = BTreeMap::new();
    for (stone, sample) in rows.into_iter().flatten() {
        faces.entry(stone).or_default().push(sample);
    }
    faces
}
