//! Distances to the nearest point, for consecutive points that lie close together.

use super::grid_index::GridIndex;
use nalgebra::Point3;
use pulp::{Arch, Simd, WithSimd};
use std::array::from_fn;

/// A multiple of the numbers in a vector of any processor.
const LANES: usize = 8;
/// Largest number of candidates. Where more points lie around a cube, a search that begins in a small box is faster.
const MOST: usize = 512;
/// Distance, in cells, up to which the nearest point is among the candidates: a cell, less a margin for rounding.
const REACH: f64 = 0.999;

/// The points in a cube of 2 x 2 x 2 cells of an index and in the cells around it: the nearest point of a point in the
/// cube is among them, if it is nearer than a cell. Gathered once for all points in the cube that follow each other.
pub(crate) struct Candidates<'a> {
    index: &'a GridIndex,
    cube: Option<[usize; 3]>,
    /// Whether there are too many to be gathered.
    are_many: bool,
    /// Coordinates along each axis, a multiple of [`LANES`]; the last ones may be infinitely far.
    axes: [Vec<f64>; 3],
}

impl<'a> Candidates<'a> {
    /// An empty set of candidates of an index.
    pub fn new(index: &'a GridIndex) -> Self {
        Self {
            index,
            cube: None,
            are_many: false,
            axes: Default::default(),
        }
    }

    /// Squared distance to the nearest point within `max_m`, as [`GridIndex::nearest`] finds it.
    pub fn nearest(&mut self, p: &Point3<f64>, max_m: f64) -> Option<f64> {
        if self.index.is_empty() {
            return None;
        }
        let cube = self.index.cube_of(p);
        if self.cube != Some(cube) {
            self.gather(cube);
        }
        if !self.are_many {
            let least = Arch::new().dispatch(LeastSquare(&self.axes, p));
            let reach_m = (REACH * self.index.cell_m).min(max_m);
            if least <= reach_m * reach_m {
                return Some(least);
            }
        }
        self.index.nearest(p, max_m).map(|(_, square)| square)
    }

    fn gather(&mut self, cube: [usize; 3]) {
        self.cube = Some(cube);
        self.axes.iter_mut().for_each(Vec::clear);
        let axes = &mut self.axes;
        self.are_many = self.index.any_around_cube(cube, |points| {
            for (a, axis) in axes.iter_mut().enumerate() {
                axis.extend(points.iter().map(|p| p[a]));
            }
            axes[0].len() > MOST
        });
        for axis in axes {
            axis.resize(axis.len().next_multiple_of(LANES), f64::INFINITY);
        }
    }
}

/// The least squared distance of a point from candidates. The loop is compiled for the widest vectors of the
/// processor.
struct LeastSquare<'a>(&'a [Vec<f64>; 3], &'a Point3<f64>);

impl WithSimd for LeastSquare<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let Self(axes, p) = self;
        let [x, y, z] = axes.each_ref().map(|axis| axis.as_chunks::<LANES>().0);
        let mut least = [f64::INFINITY; LANES];
        for ((x, y), z) in x.iter().zip(y).zip(z) {
            let square: [f64; LANES] = from_fn(|k| {
                let (dx, dy, dz) = (x[k] - p.x, y[k] - p.y, z[k] - p.z);
                dx * dx + dy * dy + dz * dz
            });
            least = from_fn(|k| if square[k] < least[k] { square[k] } else { least[k] });
        }
        least.into_iter().fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn nearest_points_are_those_of_brute_force_in_and_beside_any_cloud() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        // A surface, a dense clump on it and a few stray points.
        let mut cloud: Vec<Point3<f64>> = (0..3000)
            .map(|_| {
                Point3::new(
                    rng.random_range(0.0..4.0),
                    rng.random_range(0.0..0.02),
                    rng.random_range(0.0..3.0),
                )
            })
            .collect();
        cloud.extend((0..2000).map(|_| Point3::from([0, 1, 2].map(|_| 1.0 + rng.random_range(0.0..0.01)))));
        cloud.extend([[9.0, 0.0, 1.0], [2.0, 3.0, 1.0]].map(Point3::from));
        let mut points: Vec<Point3<f64>> = (0..2000)
            .map(|_| {
                let [x, y, z] = [-0.5..4.5, -0.1..0.1, -0.5..3.5].map(|range| rng.random_range(range));
                Point3::new(x, y, z)
            })
            .collect();
        points.extend((0..500).map(|_| Point3::from([0, 1, 2].map(|_| 1.0 + rng.random_range(-0.02..0.03)))));
        for cell_m in [0.004, 0.05, 0.8] {
            let index = GridIndex::new(&cloud, cell_m);
            let mut candidates = Candidates::new(&index);
            for p in &points {
                let brute = cloud
                    .iter()
                    .map(|q| (q - p).norm_squared())
                    .fold(f64::INFINITY, f64::min);
                for max_m in [0.03, 1.0] {
                    let expected = (brute <= max_m * max_m).then_some(brute);
                    assert_eq!(candidates.nearest(p, max_m), expected, "{p} {cell_m} {max_m}");
                }
            }
        }
        assert_eq!(
            Candidates::new(&GridIndex::new(&[], 1.0)).nearest(&Point3::origin(), 1.0),
            None
        );
    }
}
