//! Where the stones of an epoch lie, coarsely, as a third criterion beside centroids and areas.

use crate::geometry::{CellMap, cells_around, floor};
use crate::id::StoneId;
use crate::stone::Stone;
use nalgebra::{Point3, Vector3};

/// Side of the voxels, metres: finer than half a small stone, coarser than point spacing and noise.
const VOXEL_M: f64 = 0.03;
/// Stones that meet in fewer voxels than this have not been compared.
const MIN_CELLS: usize = 4;

type Voxel = [i32; 3];
/// A cube of [`BLOCK`] voxels a side.
type Block = [i32; 3];
/// Number of points, and their sum about a voxel's corner.
type Sum = (u32, Vector3<f32>);

/// Edge of a block of voxels whose occupancy fits in 64 bits, voxels.
const BLOCK: i32 = 4;

/// The voxels that the points of each stone of an epoch occupy.
///
/// Memory: 35 to 70 bytes a voxel; 5,000 m^2 of stones take up to 0.5 GB.
#[derive(Default)]
pub struct Footprints {
    /// Points of each stone in each of its voxels. Stones may share a voxel.
    stones: CellMap<StoneId, CellMap<Voxel, Sum>>,
    /// One bit a voxel of each block: whether any stone has points there.
    occupied: CellMap<Block, u64>,
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
        let sum = self.stones.entry(stone).or_default().entry(voxel).or_default();
        if sum.0 == 0 {
            let (block, bit) = bit_of(voxel);
            *self.occupied.entry(block).or_default() |= bit;
        }
        sum.0 += 1;
        sum.1 += offset;
    }

    /// Mean points of the voxels of a stone, in no particular order; none for an unknown stone.
    fn places(&self, stone: StoneId) -> impl Iterator<Item = Point3<f64>> {
        let sums = self.stones.get(&stone).into_iter().flatten();
        sums.map(|(voxel, (count, sum))| corner(*voxel) + sum.cast::<f64>() / f64::from(*count))
    }

    /// What a place has to do with a stone: the stone itself in its voxel or one beside it, else another
    /// stone, else none; none as well for an unknown stone.
    fn shows(&self, place: &Point3<f64>, stone: StoneId) -> Option<bool> {
        let around = || neighbours(voxel_of(place));
        let own = self.stones.get(&stone)?;
        if around().any(|voxel| own.contains_key(&voxel)) {
            return Some(true);
        }
        let is_occupied = |voxel: Voxel| {
            let (block, bit) = bit_of(voxel);
            self.occupied.get(&block).is_some_and(|bits| bits & bit != 0)
        };
        around().any(is_occupied).then_some(false)
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
    move |a, b, shift| {
        let (mut met, mut missed) = ([0usize; 2], 0usize);
        for place in first.places(a.id) {
            match second.shows(&(place + shift), b.id) {
                Some(true) => met[0] += 1,
                Some(false) => missed += 1,
                None => {}
            }
        }
        for place in second.places(b.id) {
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

/// A voxel, then the 26 around it: the first mostly holds the stone that is sought.
fn neighbours(voxel: Voxel) -> impl Iterator<Item = Voxel> {
    let beside = cells_around(voxel).filter(move |v| *v != voxel);
    std::iter::once(voxel).chain(beside)
}

/// The block of a voxel, and the voxel's bit in it.
fn bit_of(voxel: Voxel) -> (Block, u64) {
    let [x, y, z] = voxel.map(|c| c.rem_euclid(BLOCK));
    (
        voxel.map(|c| c.div_euclid(BLOCK)),
        1 << ((x * BLOCK + y) * BLOCK + z),
    )
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
