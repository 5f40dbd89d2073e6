//! Bulges of every place and size: which stones take part in each, and by how much.

use crate::geometry::{Bounds, cells_around};
use nalgebra::Point3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Diameters of the bulges, metres. The longest that count are twice as long as the wall: half of such a bulge bends
/// the wall from one end to the other.
const DIAMETERS_M: [f64; 15] = [
    0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 15.0, 20.0, 30.0, 60.0, 120.0,
];
/// Distance of the middles of bulges, as a share of their diameter.
const STRIDE: f64 = 0.25;
/// Fewest stones of a bulge, and the share of its amplitude from which a stone is one of them: what moves less is the rim.
const LEAST_STONES: usize = 3;
pub(crate) const RIM: f64 = 0.25;
/// Numbers of the directions along the wall and up.
pub(crate) const IN_FACE: [usize; 2] = [0, 1];
/// Number of the direction out of the wall.
pub(crate) const OUT: usize = 2;

/// A bulge of some place and size.
pub(crate) struct Shape {
    /// Where it is largest.
    pub middle: Point3<f64>,
    pub diameter_m: f64,
    /// Stones and by how much of the amplitude they move.
    pub stones: Vec<(usize, f64)>,
}

/// Share of its amplitude by which a bulge moves a point at this distance from its middle: cos^2(pi r / diameter).
pub(crate) fn share(distance_m: f64, diameter_m: f64) -> f64 {
    match distance_m < 0.5 * diameter_m {
        true => (PI * distance_m / diameter_m).cos().powi(2),
        false => 0.0,
    }
}

/// All bulges of these stones, with one middle in each small cell that has stones.
pub(crate) fn shapes(stones: &[usize], place: impl Fn(usize) -> Point3<f64> + Sync) -> Vec<Shape> {
    let extent_m = Bounds::of(stones.iter().map(|&i| place(i))).map_or(0.0, |b| (b.max - b.min).norm());
    let mut shapes = Vec::new();
    for diameter_m in DIAMETERS_M.into_iter().filter(|d| *d < 2.0 * extent_m) {
        let near = Cells::new(stones, 0.5 * diameter_m, &place);
        let of_middle = |cell: &Vec<usize>| {
            let middle = place(*cell.first()?);
            let of_stone = |i: usize| (i, share((place(i) - middle).norm(), diameter_m));
            let stones = near
                .around(&middle)
                .map(of_stone)
                .filter(|(_, share)| *share > 0.0);
            let stones: Vec<(usize, f64)> = stones.collect();
            let inside = stones.iter().filter(|(_, share)| *share > RIM).count();
            (inside >= LEAST_STONES).then_some(Shape {
                middle,
                diameter_m,
                stones,
            })
        };
        let middles = Cells::new(stones, STRIDE * diameter_m, &place);
        shapes.par_extend(middles.cells.par_iter().filter_map(|(_, cell)| of_middle(cell)));
    }
    shapes
}

/// Stones by the cube that they lie in.
struct Cells {
    side_m: f64,
    cells: BTreeMap<[i64; 3], Vec<usize>>,
}

impl Cells {
    fn new(stones: &[usize], side_m: f64, place: impl Fn(usize) -> Point3<f64>) -> Self {
        let mut cells: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
        for &i in stones {
            cells.entry(Self::key(side_m, &place(i))).or_default().push(i);
        }
        Self { side_m, cells }
    }

    fn key(side_m: f64, place: &Point3<f64>) -> [i64; 3] {
        place.coords.map(|x| (x / side_m).floor() as i64).into()
    }

    /// The stones in the cube of a place and in those that touch it: all within the side, and some beyond.
    fn around(&self, place: &Point3<f64>) -> impl Iterator<Item = usize> + '_ {
        let keys = cells_around(Self::key(self.side_m, place));
        keys.filter_map(|key| self.cells.get(&key)).flatten().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stone_within_a_bulge_takes_part_by_its_distance_from_the_middle() {
        let places: Vec<Point3<f64>> = (0..60)
            .map(|k| {
                Point3::new(
                    0.01 * f64::from(k % 3),
                    0.31 * f64::from(k % 10),
                    0.22 * f64::from(k / 10),
                )
            })
            .collect();
        let all: Vec<usize> = (0..60).collect();
        let shapes = shapes(&all, |i| places[i]);
        // At 0.5 m no three stones count, and 6 m are more than twice the diagonal of 2.999 m.
        let smallest = shapes.iter().map(|s| s.diameter_m).fold(f64::INFINITY, f64::min);
        let largest = shapes.iter().map(|s| s.diameter_m).fold(0.0, f64::max);
        assert_eq!((smallest, largest), (0.75, 4.0));
        for shape in &shapes {
            let mut expected: Vec<(usize, f64)> = Vec::new();
            for (i, place) in places.iter().enumerate() {
                let r = (place - shape.middle).norm() / shape.diameter_m;
                if r < 0.5 {
                    expected.push((i, 0.5 + 0.5 * (2.0 * PI * r).cos()));
                }
            }
            let mut found = shape.stones.clone();
            found.sort_by_key(|s| s.0);
            assert_eq!(found.len(), expected.len());
            for (found, expected) in found.iter().zip(&expected) {
                assert!(found.0 == expected.0 && (found.1 - expected.1).abs() < 1e-12);
            }
        }
    }
}
