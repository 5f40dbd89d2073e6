//! What errors at the points of the stones do to the motions.
//!
//! A stone follows its neighbours, so that an error of a station which one stone sees and its neighbours do not is in the
//! motions of all of them, smoothed as the adjustment smooths. A rigid motion of all points passes as it is.

use super::model::Row;
use crate::id::StoneId;
use crate::linalg::{BlockFactor, BlockPattern};
use crate::registration::adjustment::JointMotions;
use nalgebra::{Matrix3, SVector};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Coefficients that are a smaller share of the largest one count nothing.
const NEGLIGIBLE: f64 = 1e-3;

/// The last solution of an adjustment, for stones in an order of their own.
#[derive(Clone, Copy)]
pub struct Response<'a> {
    /// The solution.
    pub motions: &'a JointMotions,
    /// The stones of the first epoch at which errors are given.
    pub stones: &'a [StoneId],
}

impl Response<'_> {
    /// The rows of the motions of stones whose points have the errors of `rows`. `rigidly`: the part of an unknown, by its
    /// number, at a stone that all points follow as a rigid body. The rows themselves where memory does not suffice.
    pub(super) fn of(&self, rows: &[Row], rigidly: impl Fn(usize, usize) -> Matrix3<f64> + Sync) -> Vec<Row> {
        let motions = self.motions;
        let Some(pattern) = BlockPattern::<9>::new(motions.stones.len(), &motions.edges) else {
            return rows.to_vec();
        };
        let Some(factor) = pattern.factor(&motions.information) else {
            return rows.to_vec();
        };
        let nodes = self.nodes();
        let unknowns: BTreeSet<usize> = rows.iter().flatten().map(|(first, _)| *first).collect();
        let unknowns: Vec<usize> = unknowns.into_iter().collect();
        let of_unknown = |first: &usize| {
            let own = |row: &Row| -> Matrix3<f64> {
                row.iter().filter(|(k, _)| k == first).map(|(_, by)| by).sum()
            };
            let rest: Vec<Matrix3<f64>> = rows
                .iter()
                .zip(0..)
                .map(|(row, k)| own(row) - rigidly(*first, k))
                .collect();
            let followed = self.followed(&factor, &nodes, &rest);
            followed
                .into_iter()
                .zip(0..)
                .map(|(by, k)| by + rigidly(*first, k))
                .collect()
        };
        let columns: Vec<Vec<Matrix3<f64>>> = unknowns.par_iter().map(of_unknown).collect();

        let mut found = vec![Row::new(); rows.len()];
        for (first, column) in unknowns.iter().zip(columns) {
            let largest = column.iter().map(Matrix3::norm).fold(0.0, f64::max);
            for (row, by) in found.iter_mut().zip(column) {
                if by.norm() > NEGLIGIBLE * largest {
                    row.push((*first, by));
                }
            }
        }
        found
    }

    /// The node of each stone.
    fn nodes(&self) -> Vec<Option<usize>> {
        let nodes: BTreeMap<StoneId, usize> = self.motions.pulls.iter().map(|p| p.stone).zip(0..).collect();
        self.stones
            .iter()
            .map(|stone| nodes.get(stone).copied())
            .collect()
    }

    /// What motions follow of these errors of the stones' points, a column for each direction.
    fn followed(
        &self,
        factor: &BlockFactor<9>,
        nodes: &[Option<usize>],
        errors: &[Matrix3<f64>],
    ) -> Vec<Matrix3<f64>> {
        let pulls = &self.motions.pulls;
        let solve = |c: usize| {
            let mut right = vec![SVector::<f64, 9>::zeros(); pulls.len()];
            for (node, error) in nodes.iter().zip(errors) {
                if let Some(node) = *node {
                    right[node] += pulls[node].on_field * error.column(c);
                }
            }
            factor.solve(&right)
        };
        let fields = [solve(0), solve(1), solve(2)];
        let of_stone = |(node, error): (&Option<usize>, &Matrix3<f64>)| {
            let Some(stone) = node.and_then(|node| self.motions.stones[node].as_ref()) else {
                return *error;
            };
            let node = node.unwrap_or_default();
            let by_field = |c: usize| stone.by_field * fields[c][node];
            Matrix3::from_columns(&[by_field(0), by_field(1), by_field(2)]) + pulls[node].on_stone * error
        };
        nodes.iter().zip(errors).map(of_stone).collect()
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
        let pattern = BlockPattern::<9>::new(motions.stones.len(), &motions.edges).unwrap();
        let factor = pattern.factor(&motions.information).unwrap();
        let error = |k: u32| {
            if errs(k) {
                Matrix3::identity()
            } else {
                Matrix3::zeros()
            }
        };
        let errors: Vec<Matrix3<f64>> = (0..stones.len() as u32).map(error).collect();
        let followed = response.followed(&factor, &response.nodes(), &errors);

        let (mut apart, mut largest): (f64, f64) = (0.0, 0.0);
        for ((before, after), by) in still.results.iter().zip(&moved.results).zip(&followed) {
            let change =
                after.motion.as_ref().unwrap().displacement - before.motion.as_ref().unwrap().displacement;
            apart = apart.max((change - by * shift).norm());
            largest = largest.max((change - shift / 3.0).norm());
        }
        assert!(apart < 0.15 * shift.norm(), "{apart} of {largest}");
    }
}
