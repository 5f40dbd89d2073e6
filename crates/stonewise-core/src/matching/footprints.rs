//! Where the stones of an epoch lie, coarsely, as a third criterion beside centroids and areas.

use crate::geometry::{CellMap, floor};
use crate::id::StoneId;
use crate::stone::Stone;
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;

/// Side of the voxels, metres: finer than half a small stone, coarser than point spacing and noise.
const VOXEL_M: f64 = 0.03;
/// Stones that meet in fewer voxels than this have not been compared.
const MIN_CELLS: usize = 4;

type Voxel = [i32; 3];

/// The voxels that the points of each stone of an epoch occupy.
///
/// Memory: about 90 bytes a voxel; 5,000 m^2 of stones take some 0.6 GB.
#[derive(Default)]
pub struct Footprints {
    /// Points of a stone in a voxel, with their sum about the voxel's corner; a voxel may hold several
    /// stones.
    voxels: CellMap<Voxel, Vec<(StoneId, u32, Vector3<f32>)>>,
}

impl Footprints {
    /// Footprints without points.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a point of a stone.
    pub fn add(&mut self, stone: StoneId, world: &Point3<f64>) {
        let voxel = voxel_of(world);
        let offset = (world - corner(voxel)).cast::<f32>();
        // Nearly all voxels hold one stone; a list that grows by itself would begin with room for four.
        let here = self.voxels.entry(voxel).or_insert_with(|| Vec::with_capacity(1));
        match here.iter_mut().find(|h| h.0 == stone) {
            Some(entry) => {
                entry.1 += 1;
                entry.2 += offset;
            }
            None => here.push((stone, 1, offset)),
        }
    }

    /// Mean points of the voxels of each stone, in the order of the grid.
    fn by_stone(&self) -> BTreeMap<StoneId, Vec<Point3<f64>>> {
        let mut voxels: Vec<&Voxel> = self.voxels.keys().collect();
        voxels.sort_unstable();
        let mut found: BTreeMap<StoneId, Vec<Point3<f64>>> = BTreeMap::new();
        for voxel in voxels {
            for (stone, count, sum) in &self.voxels[voxel] {
                let mean = corner(*voxel) + sum.cast::<f64>() / f64::from(*count);
                found.entry(*stone).or_default().push(mean);
            }
        }
        found
    }

    /// What a place has to do with a stone: the stone itself in its voxel or one beside it, else another
    /// stone, else none.
    fn shows(&self, place: &Point3<f64>, stone: StoneId) -> Option<bool> {
        let [x, y, z] = voxel_of(place);
        let mut other = None;
        for i in 0..27 {
            let Some(here) = self
                .voxels
                .get(&[x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1])
            else {
                continue;
            };
            if here.iter().any(|h| h.0 == stone) {
                return Some(true);
            }
            other = Some(false);
        }
        other
    }
}

/// How far two stones of two epochs cover each other: intersection over union, counted only where both epochs
/// show some stone, so that holes, shadows and parts that a mask leaves out do not count against a pair, but
/// other stones do.
///
/// The result is made for [`Surroundings::overlap`](super::Surroundings::overlap): it takes a stone of each
/// epoch and the shift of the first, and gives `None` where the two hardly meet.
pub fn footprint_overlap<'a>(
    first: &'a Footprints,
    second: &'a Footprints,
) -> impl Fn(&Stone, &Stone, &Vector3<f64>) -> Option<f64> + Sync + 'a {
    let (cells_1, cells_2) = (first.by_stone(), second.by_stone());
    move |a, b, shift| {
        let (mut met, mut missed) = ([0usize; 2], 0usize);
        for place in cells_1.get(&a.id)? {
            match second.shows(&(place + shift), b.id) {
                Some(true) => met[0] += 1,
                Some(false) => missed += 1,
                None => {}
            }
        }
        for place in cells_2.get(&b.id)? {
            match first.shows(&(place - shift), a.id) {
                Some(true) => met[1] += 1,
                Some(false) => missed += 1,
                None => {}
            }
        }
        let common = met[0] + met[1];
        (met[0].min(met[1]) >= MIN_CELLS).then(|| common as f64 / (common + missed) as f64)
    }
}

fn voxel_of(p: &Point3<f64>) -> Voxel {
    [0, 1, 2].map(|a| floor(p[a] / VOXEL_M) as i32)
}

fn corner(voxel: Voxel) -> Point3<f64> {
    Point3::from(voxel.map(|c| f64::from(c) * VOXEL_M))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patch(footprints: &mut Footprints, id: u32, y: [f64; 2], z: [f64; 2], shift: &Vector3<f64>) {
        let steps = |r: [f64; 2]| (0..((r[1] - r[0]) / 0.01) as i32).map(move |i| r[0] + 0.01 * f64::from(i));
        for y in steps(y) {
            for z in steps(z) {
                footprints.add(StoneId(id), &(Point3::new(0.0, y, z) + shift));
            }
        }
    }

    fn stone(id: u32) -> Stone {
        Stone {
            id: StoneId(id),
            centroid: Point3::origin(),
            normal: Vector3::x(),
            area_m2: 0.1,
            points: 1,
            photos: 1,
            confidence: 1.0,
        }
    }

    #[test]
    fn holes_do_not_count_but_other_stones_do() {
        let shift = Vector3::new(0.02, 0.31, -0.17);
        let (mut one, mut two) = (Footprints::new(), Footprints::new());
        // The first epoch sees a quarter of stone 1, all of 2 and 3; the second has 1 whole and 2 and 3 as
        // one.
        patch(&mut one, 1, [0.0, 0.15], [0.0, 0.15], &Vector3::zeros());
        patch(&mut one, 2, [0.4, 0.7], [0.0, 0.3], &Vector3::zeros());
        patch(&mut one, 3, [0.73, 1.03], [0.0, 0.3], &Vector3::zeros());
        patch(&mut two, 1, [0.0, 0.3], [0.0, 0.3], &shift);
        patch(&mut two, 2, [0.4, 1.03], [0.0, 0.3], &shift);
        let overlap = footprint_overlap(&one, &two);
        assert_eq!(overlap(&stone(1), &stone(1), &shift), Some(1.0));
        let merged = overlap(&stone(2), &stone(2), &shift).unwrap();
        assert!((0.6..0.8).contains(&merged), "{merged}");
        assert_eq!(overlap(&stone(1), &stone(2), &shift), None);
        assert_eq!(overlap(&stone(1), &stone(9), &shift), None);
    }
}
