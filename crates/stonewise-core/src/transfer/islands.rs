//! Parts of a stone that are cut off from its main body.

use super::TransferParams;
use crate::components::components;
use crate::geometry::{CellMap, CellSet, cell_of, cells_around};
use nalgebra::Point3;
use std::collections::{BTreeMap, BTreeSet};

/// Cubic cell of a world-aligned grid.
pub(super) type Voxel = [i64; 3];

/// Where each stone has points, counted in voxels across tiles.
pub(super) struct Occupancy {
    voxel_m: f64,
    /// Points in each voxel of each stone.
    counts: CellMap<u32, CellMap<Voxel, u32>>,
}

/// What must lose its label.
pub(super) struct Removal {
    voxel_m: f64,
    /// Voxels of islands and of whole stones.
    pub voxels: CellSet<(u32, Voxel)>,
    /// Islands and points on them, of stones that stay.
    pub islands: BTreeMap<u32, (u32, u64)>,
    /// Stones that go, with their points.
    pub stones: BTreeMap<u32, u64>,
    /// Stones that stay.
    pub kept: BTreeSet<u32>,
}

impl Occupancy {
    /// Without points; `voxel_m`: side of the voxels, metres.
    pub(super) fn new(voxel_m: f64) -> Self {
        Self {
            voxel_m,
            counts: CellMap::default(),
        }
    }

    /// Adds points with their stones. Runs of points in the same voxel are counted together.
    pub(super) fn add_all(&mut self, points: impl Iterator<Item = (u32, Point3<f64>)>) {
        let mut last: Option<((u32, Voxel), u32)> = None;
        for (stone, world) in points {
            let key = (stone, cell_of(&world, self.voxel_m));
            match &mut last {
                Some((same, count)) if *same == key => *count += 1,
                _ => {
                    let before = last.replace((key, 1));
                    self.add(before);
                }
            }
        }
        self.add(last);
    }

    fn add(&mut self, counted: Option<((u32, Voxel), u32)>) {
        if let Some(((stone, voxel), count)) = counted {
            *self.counts.entry(stone).or_default().entry(voxel).or_default() += count;
        }
    }

    /// Finds islands smaller than a share of their stone's largest part, and stones with too few points.
    ///
    /// Parts hang together where their voxels touch, corners included.
    pub(super) fn removal(self, params: &TransferParams) -> Removal {
        let mut removal = Removal {
            voxel_m: self.voxel_m,
            voxels: CellSet::default(),
            islands: BTreeMap::new(),
            stones: BTreeMap::new(),
            kept: BTreeSet::new(),
        };
        for (stone, voxels) in self.counts {
            removal.judge(stone, parts(voxels.into_iter().collect()), params);
        }
        removal
    }
}

/// A connected part: its voxels and the number of its points.
type Part = (Vec<Voxel>, u64);

impl Removal {
    fn judge(&mut self, stone: u32, parts: Vec<Part>, params: &TransferParams) {
        let largest = parts.iter().map(|p| p.1).max().unwrap_or(0);
        let limit = params.island_share * largest as f64;
        let (kept, dropped): (Vec<Part>, Vec<Part>) = parts.into_iter().partition(|p| p.1 as f64 >= limit);
        let points = |parts: &[Part]| parts.iter().map(|p| p.1).sum::<u64>();
        let remaining = points(&kept);
        let gone = remaining < u64::from(params.min_points);
        if gone {
            self.stones.insert(stone, remaining + points(&dropped));
        } else {
            self.kept.insert(stone);
            if !dropped.is_empty() {
                self.islands
                    .insert(stone, (dropped.len() as u32, points(&dropped)));
            }
        }
        let gone = if gone { kept } else { Vec::new() };
        let voxels = dropped.into_iter().chain(gone).flat_map(|p| p.0);
        self.voxels.extend(voxels.map(|v| (stone, v)));
    }

    /// Whether a point of a stone loses its label.
    pub(super) fn takes(&self, stone: u32, world: &Point3<f64>) -> bool {
        self.voxels.contains(&(stone, cell_of(world, self.voxel_m)))
    }

    /// Side of the voxels, metres.
    pub(super) fn voxel_m(&self) -> f64 {
        self.voxel_m
    }
}

fn parts(voxels: BTreeMap<Voxel, u32>) -> Vec<Part> {
    let (places, counts): (Vec<Voxel>, Vec<u32>) = voxels.into_iter().unzip();
    let places = &places;
    let beside = |i: usize| cells_around(places[i]).filter_map(|n| places.binary_search(&n).ok());
    let part = |members: Vec<usize>| {
        let points = members.iter().map(|&i| u64::from(counts[i])).sum();
        (members.into_iter().map(|i| places[i]).collect(), points)
    };
    components(places.len(), beside).into_iter().map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_far_speck_goes_a_second_half_stays_and_a_tiny_stone_goes() {
        let mut occupancy = Occupancy::new(0.04);
        let mut patch = |stone, x0: f64, n: i32| {
            for i in 0..n {
                for j in 0..n {
                    let p = Point3::new(x0 + 0.01 * f64::from(i), 0.01 * f64::from(j), 0.0);
                    occupancy.add_all(std::iter::once((stone, p)));
                }
            }
        };
        patch(1, 0.0, 20);
        patch(1, 0.5, 15);
        patch(1, 1.0, 3);
        patch(2, 2.0, 4);
        let removal = occupancy.removal(&TransferParams::default());
        assert_eq!(removal.islands, BTreeMap::from([(1, (1, 9))]));
        assert_eq!(removal.stones, BTreeMap::from([(2, 16)]));
        assert!(removal.takes(1, &Point3::new(1.01, 0.01, 0.0)));
        assert!(!removal.takes(1, &Point3::new(0.51, 0.01, 0.0)));
        assert!(removal.takes(2, &Point3::new(2.0, 0.0, 0.0)));
    }
}
