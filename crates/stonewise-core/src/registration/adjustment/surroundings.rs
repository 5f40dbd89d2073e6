//! How the surroundings of a stone moved: where photos seek a stone that its clouds may show at a wrong place.

use super::candidate::CandidateMotion;
use super::state::Adjustment;
use super::stone_vector::StoneVector;
use crate::cloud::GridIndex;
use crate::geometry::Bounds;
use crate::statistics::component_median;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Nearest stones, whether ties join them or not, that show how the surroundings moved: twice those that a
/// start is smoothed over, so that a small island does not outvote them.
const SURROUNDINGS: usize = 24;

impl Adjustment {
    /// How the surroundings of each stone and the wall as a whole moved, world, metres: the medians of the
    /// motions of the nearest other stones, and of all.
    pub fn surroundings(&self) -> Vec<[Vector3<f64>; 2]> {
        let places: Vec<Point3<f64>> = self.prior.graph.nodes.iter().map(|n| n.centroid).collect();
        let moved: Vec<Vector3<f64>> = (0..places.len()).map(|i| self.displacement(i)).collect();
        let of_all = component_median(&moved);
        let extent_m = Bounds::of(places.iter().copied()).map_or(0.0, |b| (b.max - b.min).norm());
        let index = GridIndex::for_nearest(&places);
        let around = |i: usize| {
            let near = index.nearest_k(&places[i], SURROUNDINGS + 1, extent_m);
            let others: Vec<Vector3<f64>> = near
                .into_iter()
                .filter(|n| n.0 != i)
                .map(|(j, _)| moved[j])
                .collect();
            if others.is_empty() {
                moved[i]
            } else {
                component_median(&others)
            }
        };
        (0..places.len())
            .into_par_iter()
            .map(|i| [around(i), of_all])
            .collect()
    }

    /// Where a stone is now as the field has it, world, metres.
    fn displacement(&self, i: usize) -> Vector3<f64> {
        let to_world = self.prior.graph.nodes[i].face_from_world.transpose();
        to_world * self.stones[i].with_field.motion.translation()
    }

    /// Starts a stone anew at another place.
    pub fn put(&mut self, i: usize, place: StoneVector) {
        self.stones[i].with_field = CandidateMotion::new(place);
        self.stones[i].on_own = None;
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{begun, wall};
    use super::*;
    use crate::registration::points::MemoryPairs;

    #[test]
    fn an_island_is_outvoted_by_the_stones_around_it() {
        let pairs = MemoryPairs::new(wall(6, [0.002; 2], |_| Vector3::zeros()));
        let (mut adjustment, _) = begun(&pairs);
        let far = Vector3::new(0.0, 0.03, -0.06);
        for i in 0..adjustment.stones.len() {
            let is_island = [20, 21, 28, 29].contains(&i);
            let moved = if is_island { far } else { Vector3::zeros() };
            let frame = adjustment.prior.graph.nodes[i].face_from_world;
            adjustment.put(i, StoneVector::from_translation(frame * moved));
        }
        assert!((adjustment.displacement(20) - far).norm() < 1e-12);
        assert!(
            adjustment
                .surroundings()
                .iter()
                .flatten()
                .all(|moved| moved.norm() < 1e-12)
        );
    }
}
