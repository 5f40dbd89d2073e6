//! The error of the later epoch at the stones as a function of the unknowns, and its rigid part.

use super::epoch_pair::EpochPair;
use super::model::{Row, Solution, Unknowns};
use super::sight::{SeenStone, Sight, Source, SourcePoints, Target};
use crate::geometry::lever;
use nalgebra::{Matrix6, Point3, SMatrix, Vector3, Vector6};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Largest number of stones from which the rigid part of the error is computed.
const RIGID_STONES: usize = 500;

/// The rigid motion that lies closest to the later epoch's error at the stones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RigidError {
    /// Middle of the stones, world, metres.
    pub centre: Point3<f64>,
    /// Shift of the centre and rotation vector about it, m, rad.
    pub error: Vector6<f64>,
    /// Covariance of that, m^2, m rad, rad^2.
    pub covariance: Matrix6<f64>,
}

impl RigidError {
    /// The error at a place, world, metres.
    pub fn at(&self, place: &Point3<f64>) -> Vector3<f64> {
        lever(&(place - self.centre)) * self.error
    }
}

/// How the rigid motion closest to the error at the stones depends on the unknowns.
pub(super) struct RigidRows {
    centre: Point3<f64>,
    /// Inverse of the stones' normal equations.
    inverse: Matrix6<f64>,
    /// Right-hand sides by the first of three unknowns.
    parts: BTreeMap<usize, SMatrix<f64, 6, 3>>,
}

/// The rows for the stones of `pair`.
pub(super) fn rigid_rows(pair: &EpochPair, unknowns: &Unknowns) -> RigidRows {
    let stride = pair.stones.len().div_ceil(RIGID_STONES).max(1);
    let stones: Vec<&SeenStone> = pair.stones.iter().step_by(stride).collect();
    let count = stones.len().max(1) as f64;
    let centre = Point3::from(stones.iter().map(|s| s.centroid.coords).sum::<Vector3<f64>>() / count);
    let mut normal = Matrix6::identity() * 1e-9;
    let mut parts: BTreeMap<usize, SMatrix<f64, 6, 3>> = BTreeMap::new();
    for stone in &stones {
        let j = lever(&(stone.centroid - centre)).transpose();
        normal += j * j.transpose();
        for (first, coefficients) in difference_row(stone, pair.sources, unknowns) {
            *parts.entry(first).or_default() += j * coefficients;
        }
    }
    let inverse = normal.try_inverse().unwrap_or_else(Matrix6::zeros);
    RigidRows {
        centre,
        inverse,
        parts,
    }
}

impl RigidRows {
    /// Inverse normal equations times the right-hand sides: how the rigid motion depends on the unknowns, by
    /// the first of three.
    pub fn of_unknowns(&self) -> impl Iterator<Item = (usize, SMatrix<f64, 6, 3>)> + '_ {
        self.parts
            .iter()
            .map(|(first, part)| (*first, self.inverse * part))
    }

    /// The displacement of a place by the six parameters of the rigid motion.
    pub fn lever(&self, place: &Point3<f64>) -> SMatrix<f64, 3, 6> {
        lever(&(place - self.centre))
    }

    /// The rigid motion. `solutions`: solutions with their weights, which sum to one.
    pub fn error(&self, solutions: &[(f64, &Solution)]) -> RigidError {
        let mut error = Vector6::zeros();
        let mut covariance = Matrix6::zeros();
        for (w, solution) in solutions {
            for (a, of_a) in &self.parts {
                error += self.inverse * of_a * solution.mean.fixed_rows::<3>(*a) * *w;
                for (b, of_b) in &self.parts {
                    let block = solution.covariance.fixed_view::<3, 3>(*a, *b);
                    covariance += self.inverse * of_a * block * of_b.transpose() * self.inverse * *w;
                }
            }
        }
        RigidError {
            centre: self.centre,
            error,
            covariance: 0.5 * (covariance + covariance.transpose()),
        }
    }
}

/// How much each sight of a stone counts in its motion: each source by its share of its epoch's points, the
/// reference with the other sign.
pub(super) fn shares(stone: &SeenStone, sources: &[Source]) -> Vec<f64> {
    let total = [0, 1].map(|e| {
        let own = stone.sights.iter().filter(|s| sources[s.source].epoch == e);
        own.map(|s| s.count as f64).sum::<f64>().max(1.0)
    });
    let share = |s: &SourcePoints| {
        let epoch = sources[s.source].epoch;
        [-1.0, 1.0][epoch] * s.count as f64 / total[epoch]
    };
    stone.sights.iter().map(share).collect()
}

/// The error at the second of two neighbours less that at the first.
pub(super) fn neighbour_row(pair: &EpochPair, stones: &[usize; 2], unknowns: &Unknowns) -> Row {
    let [first, mut row] = stones.map(|k| difference_row(&pair.stones[k], pair.sources, unknowns));
    row.extend(first.into_iter().map(|(k, m)| (k, -m)));
    row
}

/// The later epoch's error less that of the reference at a stone.
pub(super) fn difference_row(stone: &SeenStone, sources: &[Source], unknowns: &Unknowns) -> Row {
    let mut row = Row::new();
    for (s, share) in stone.sights.iter().zip(shares(stone, sources)) {
        let sight = Sight {
            source: s.source,
            time_s: s.time_s,
            place: stone.centroid,
            target: Target::Stone { normal: stone.normal },
        };
        row.extend(unknowns.row(&sight).into_iter().map(|(k, m)| (k, m * share)));
    }
    row
}
