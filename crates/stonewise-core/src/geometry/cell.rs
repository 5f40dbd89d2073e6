//! Cells of a grid that starts at the origin of the world.

use nalgebra::Point3;
use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasherDefault, Hasher};
use std::ops::Add;

/// The cell that holds a point, by its lowest corner in cells of `size_m`; points on a border belong to the
/// upper cell.
#[inline]
pub fn cell_of(point: &Point3<f64>, size_m: f64) -> [i64; 3] {
    [0, 1, 2].map(|axis| floor(point[axis] / size_m))
}

/// All cells from `low` to `high`, both included.
pub fn cells_between(low: [i64; 3], high: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (low[0]..=high[0])
        .flat_map(move |x| (low[1]..=high[1]).flat_map(move |y| (low[2]..=high[2]).map(move |z| [x, y, z])))
}

/// A cell and the 26 that touch it, in ascending order.
#[inline]
pub fn cells_around<T: Copy + Add<Output = T> + From<i8>>([x, y, z]: [T; 3]) -> impl Iterator<Item = [T; 3]> {
    let beside = |coordinate: T, step: i8| coordinate + T::from(step % 3 - 1);
    (0..27i8).map(move |i| [beside(x, i / 9), beside(y, i / 3), beside(z, i)])
}

/// The largest whole number that is not above `value`; without the call that `f64::floor` is on processors of
/// before 2008, which the program must run on.
#[inline]
pub fn floor(value: f64) -> i64 {
    let towards_zero = value as i64;
    towards_zero.saturating_sub(i64::from(towards_zero as f64 > value))
}

/// A map of cells, and of other small keys of whole numbers.
pub type CellMap<K, V> = HashMap<K, V, BuildHasherDefault<CellHasher>>;
/// A set of cells.
pub type CellSet<K> = HashSet<K, BuildHasherDefault<CellHasher>>;

/// Hashes a few whole numbers in a few nanoseconds: each word is mixed in by a multiplication with an odd
/// number whose bits look random, after Knuth (1973, section 6.4). No defence against keys chosen to collide,
/// which coordinates are not.
#[derive(Clone, Copy, Debug, Default)]
pub struct CellHasher(u64);

/// 2^64 over the golden ratio.
const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;

impl CellHasher {
    #[inline]
    fn mix(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(23) ^ word).wrapping_mul(FACTOR);
    }
}

impl Hasher for CellHasher {
    #[inline]
    fn write(&mut self, bytes: &[u8]) {
        for part in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..part.len()].copy_from_slice(part);
            self.mix(u64::from_le_bytes(word));
        }
    }

    #[inline]
    fn write_u32(&mut self, word: u32) {
        self.mix(u64::from(word));
    }

    #[inline]
    fn write_usize(&mut self, word: usize) {
        self.mix(word as u64);
    }

    #[inline]
    fn finish(&self) -> u64 {
        // Tables take their places from the lowest bits, which a multiplication hardly changes.
        (self.0 ^ (self.0 >> 32)).wrapping_mul(FACTOR) ^ (self.0 >> 29)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::hash::BuildHasher;

    #[test]
    fn floors_are_those_of_the_standard_library() {
        for value in [
            0.0,
            -0.0,
            0.5,
            -0.5,
            1.0,
            -1.0,
            -1e-300,
            7.999_999_999,
            -8.000_000_1,
            1e15 + 0.5,
            -1e15 - 0.5,
        ] {
            assert_eq!(floor(value), f64::floor(value) as i64, "{value}");
        }
        assert_eq!(floor(f64::NAN), 0);
    }

    #[test]
    fn cells_of_a_wall_hardly_collide() {
        let hasher = BuildHasherDefault::<CellHasher>::default();
        let mut places = vec![0u32; 1 << 16];
        for i in 0..200i64 {
            for j in 0..200 {
                places[hasher.hash_one([56_000 + i, 3, -7_000 + j]) as usize % (1 << 16)] += 1;
            }
        }
        // 40,000 keys thrown at random leave exp(-0.61) of 65,536 places empty.
        let empty = places.iter().filter(|n| **n == 0).count() as f64 / 65_536.0;
        assert!((empty - 0.543).abs() < 0.02, "{empty}");
        assert!(places.iter().all(|n| *n < 10));
    }
}
