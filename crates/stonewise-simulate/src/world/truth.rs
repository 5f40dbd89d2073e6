//! What is true of every simulated stone, and how much of it the surveys saw.

use crate::world::deform::TrueMotion;
use crate::world::scan::Scan;
use crate::world::scene::{Scene, Target};
use crate::world::surface::SampledFaces;
use crate::world::survey::World;
use crate::world::wall::SimStone;
use crate::world::window::Window;
use nalgebra::{Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::geometry::Rigid3;
use stonewise_core::id::StoneId;
use stonewise_core::progress::{Interrupted, Progress};
use stonewise_core::raster::LabelImage;

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
    /// Cells of its face, for [`SeenCells`], as places in its own frame.
    cells: BTreeSet<[i32; 2]>,
}

/// Cells in which visibility is counted, metres: several points of the coarsest scan each.
const CELL_M: f64 = 0.025;
/// Step of the raster on the face from which cells, areas and centroids are taken, metres.
const STEP_M: f64 = 0.006;

/// The truth of all stones, in the wall's order, a piece of the section at a time.
///
/// # Errors
/// The caller stopped the work.
pub fn stone_truths(world: &World, progress: &dyn Progress) -> Result<Vec<StoneTruth>, Interrupted> {
    let extent = world.wall.extent();
    let mut truths = Vec::with_capacity(world.wall.stones.len());
    let mut sampled = SampledFaces::default();
    progress.each("truth of all stones", Window::cover(extent), |window| {
        let surface = world.next_surface(window.surroundings(extent), &mut sampled);
        truths.extend(window_truths(world, &world.scene_of(&surface, 0), &window));
        Ok::<(), Interrupted>(())
    })?;
    truths.sort_by_key(|t| t.id);
    Ok(truths)
}

/// The truth of the stones whose middle lies in a piece of the section; `scene`: of its
/// [`Window::surroundings`] before the motion. Cost: about 30,000 rays a square metre.
pub fn window_truths(world: &World, scene: &Scene, window: &Window) -> Vec<StoneTruth> {
    let faces = face_samples(scene, window);
    let stones = world.wall.stones.iter().zip(&world.motions);
    stones
        .filter(|(s, _)| window.holds(s.middle[0], s.middle[1]))
        .map(|(stone, motion)| {
            let samples = faces.get(&stone.id.0).map_or(&[][..], Vec::as_slice);
            stone_truth(world, stone, motion, samples)
        })
        .collect()
}

fn stone_truth(world: &World, stone: &SimStone, motion: &TrueMotion, samples: &[FaceSample]) -> StoneTruth {
    let mean = samples.iter().fold(Vector3::zeros(), |s, (p, _)| s + p.coords) / samples.len().max(1) as f64;
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
        normal: world.wall.face.frame(stone.middle[0]).out,
        cells: samples.iter().map(|(_, at)| cell(*at)).collect(),
    }
}

/// What scans have measured of each stone, gathered scan by scan.
pub struct SeenCells {
    /// World to stone, in the epoch of the scans.
    to_stone: Vec<Rigid3>,
    hit: Vec<BTreeSet<[i32; 2]>>,
    /// The cell that was hit last: most points lie in the same one as the point before.
    last: Vec<Option<[i32; 2]>>,
    points: Vec<u32>,
}

impl SeenCells {
    /// Nothing seen yet. `epoch`: 0 or 1, that of the scans.
    pub fn new(world: &World, epoch: usize) -> Self {
        let stones = world.wall.stones.iter().zip(&world.motions);
        let to_stone = stones.map(|(stone, motion)| {
            let pose = if epoch == 0 {
                stone.world_from_stone
            } else {
                motion.second_from_first * stone.world_from_stone
            };
            pose.inverse()
        });
        let count = world.wall.stones.len();
        Self {
            to_stone: to_stone.collect(),
            hit: vec![BTreeSet::new(); count],
            last: vec![None; count],
            points: vec![0; count],
        }
    }

    /// Adds what a scan measured.
    pub fn add(&mut self, scan: &Scan) {
        for (i, &stone) in scan.stone.iter().enumerate().filter(|(_, s)| **s > 0) {
            let stone = stone as usize - 1;
            self.points[stone] += 1;
            let exact = scan.cloud.origin() + Vector3::from(scan.exact[i]).cast::<f64>();
            let local = self.to_stone[stone] * exact;
            let at = cell([local.x, local.y]);
            if self.last[stone].replace(at) != Some(at) {
                self.hit[stone].insert(at);
            }
        }
    }

    /// Points of each stone, in the wall's order.
    pub fn points(&self) -> &[u32] {
        &self.points
    }

    /// Cells of each stone's face that were measured, in the wall's order; [`StoneTruth::seen_share`] says
    /// what they are worth.
    pub fn cells(&self, truths: &[StoneTruth]) -> Vec<u32> {
        let both = |(t, h): (&StoneTruth, &BTreeSet<_>)| h.intersection(&t.cells).count() as u32;
        truths.iter().zip(&self.hit).map(both).collect()
    }

    /// Share of each stone's face that was measured, 0..1, in the wall's order.
    pub fn shares(&self, truths: &[StoneTruth]) -> Vec<f64> {
        let share = |(t, cells): (&StoneTruth, u32)| t.seen_share(cells);
        truths.iter().zip(self.cells(truths)).map(share).collect()
    }
}

/// Stones of which a photo shows at least `pixels` pixels, ascending; `labels`: the stone's number at each
/// pixel, 0 elsewhere.
pub fn shown_stones(labels: &LabelImage, pixels: u32) -> Vec<u32> {
    let mut seen: BTreeMap<u32, u32> = BTreeMap::new();
    for &label in labels.data().iter().filter(|l| **l > 0) {
        *seen.entry(label).or_default() += 1;
    }
    seen.retain(|_, count| *count >= pixels);
    seen.into_keys().collect()
}

impl StoneTruth {
    /// Share of the face that was measured where `cells` of its cells were, 0..1.
    pub fn seen_share(&self, cells: u32) -> f64 {
        f64::from(cells) / self.cells.len().max(1) as f64
    }
}

fn cell(at: [f64; 2]) -> [i32; 2] {
    at.map(|v| (v / CELL_M).floor() as i32)
}

/// A point of a stone's face, in the world and in the stone's frame.
type FaceSample = (Point3<f64>, [f64; 2]);

/// Points of each stone's face on a square raster, of the stones whose middle the window holds.
fn face_samples(scene: &Scene, window: &Window) -> BTreeMap<u32, Vec<FaceSample>> {
    use rayon::prelude::*;
    let w = scene.window();
    let steps = [0, 2].map(|i| ((w[i + 1] - w[i]) / STEP_M) as usize);
    let rows: Vec<Vec<_>> = (0..steps[1])
        .into_par_iter()
        .map(|j| {
            let u = w[2] + (j as f64 + 0.5) * STEP_M;
            let sample = |i: usize| {
                let (point, target) = scene.target_on_face(w[0] + (i as f64 + 0.5) * STEP_M, u)?;
                match target {
                    Target::Stone(k, at) => {
                        let [a, u] = scene.wall().stones[k].middle;
                        window.holds(a, u).then_some((k as u32 + 1, (point, at)))
                    }
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
