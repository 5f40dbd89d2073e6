//! What errors at the points of the stones do to the motions.
//!
//! A stone follows its neighbours, so that an error of a station which one stone sees and its neighbours do not is in the
//! motions of all of them, smoothed as the adjustment smooths. A rigid motion of all points passes as it is.

use crate::id::StoneId;
use crate::linalg::BlockPattern;
use crate::registration::adjustment::JointMotions;
use nalgebra::{SVector, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The last solution of an adjustment, for stones in an order of their own.
#[derive(Clone, Copy)]
pub struct Response<'a> {
    /// The solution.
    pub motions: &'a JointMotions,
    /// The stones of the first epoch at which errors are given.
    pub stones: &'a [StoneId],
}

impl Response<'_> {
    /// What the motions of the stones follow of these errors of their points, world, metres; several errors share a
    /// factorisation. `None` where memory does not suffice.
    pub(super) fn of(&self, errors: &[Vec<Vector3<f64>>]) -> Option<Vec<Vec<Vector3<f64>>>> {
        let motions = self.motions;
        let pattern = BlockPattern::<9>::new(motions.stones.len(), &motions.edges)?;
        let factor = pattern.factor(&motions.information)?;
        let nodes: BTreeMap<StoneId, usize> = motions.pulls.iter().map(|p| p.stone).zip(0..).collect();
        let node_of = |stone: &StoneId| nodes.get(stone).copied();

        let of_one = |errors: &Vec<Vector3<f64>>| {
            let mut right = vec![SVector::<f64, 9>::zeros(); motions.pulls.len()];
            for (stone, error) in self.stones.iter().zip(errors) {
                if let Some(node) = node_of(stone) {
                    right[node] += motions.pulls[node].on_field * error;
                }
            }
            let field = factor.solve(&right);

            let followed = |(stone, error): (&StoneId, &Vector3<f64>)| {
                let measured = node_of(stone).and_then(|node| Some((node, motions.stones[node].as_ref()?)));
                match measured {
                    Some((node, stone)) => {
                        stone.by_field * field[node] + motions.pulls[node].on_stone * error
                    }
                    None => *error,
                }
            };
            self.stones.iter().zip(errors).map(followed).collect()
        };
        Some(errors.par_iter().map(of_one).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::registration::adjustment::testing::wall;
    use crate::registration::{AdjustmentParams, AdjustmentReport, MemoryPairs, PairPoints, adjust};
    use nalgebra::Vector3;

    fn adjusted(pairs: Vec<PairPoints>) -> AdjustmentReport {
        adjust(&MemoryPairs::new(pairs), &AdjustmentParams::default(), &Silent).unwrap()
    }

    #[test]
    fn motions_follow_errors_of_points_as_the_adjustment_does() {
        // The points of every third stone of the later epoch err by a fraction of their noise.
        let shift = Vector3::new(0.1e-3, 0.3e-3, -0.2e-3);
        let errs = |k: u32| k.is_multiple_of(3);
        let still = adjusted(wall(4, [1e-3; 2], |_| Vector3::zeros()));
        let moved = adjusted(wall(
            4,
            [1e-3; 2],
            |k| if errs(k) { shift } else { Vector3::zeros() },
        ));

        let motions = still.joint.as_ref().unwrap();
        let stones: Vec<StoneId> = motions.pulls.iter().map(|p| p.stone).collect();
        let response = Response {
            motions,
            stones: &stones,
        };
        let error = |k: u32| if errs(k) { shift } else { Vector3::zeros() };
        let errors: Vec<Vector3<f64>> = (0..stones.len() as u32).map(error).collect();
        let followed = response.of(&[errors]).unwrap().concat();

        let (mut apart, mut largest): (f64, f64) = (0.0, 0.0);
        for ((before, after), by) in still.results.iter().zip(&moved.results).zip(&followed) {
            let change =
                after.motion.as_ref().unwrap().displacement - before.motion.as_ref().unwrap().displacement;
            apart = apart.max((change - by).norm());
            largest = largest.max((change - shift / 3.0).norm());
        }
        assert!(apart < 0.15 * shift.norm(), "{apart} of {largest}");
    }
}
