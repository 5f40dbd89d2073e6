//! The errors of all stones as functions of the unknowns: of their points, and of their motions.

use super::epoch_pair::EpochPair;
use super::model::{Row, Unknowns};
use super::rigid::{RigidRows, difference_row};
use super::sight::SeenStone;
use nalgebra::{Matrix3, SMatrix};
use std::collections::BTreeMap;

/// The rows of all stones.
pub(super) struct StoneRows {
    pub of_points: Vec<Row>,
    pub of_motions: Vec<Row>,
}

impl StoneRows {
    /// `rigid`: the rigid motion that is the closest to the errors, which motions follow as it is.
    pub fn new(pair: &EpochPair, unknowns: &Unknowns, rigid: &RigidRows) -> Self {
        let of_stone = |s: &SeenStone| difference_row(s, pair.sources, unknowns);
        let of_points: Vec<Row> = pair.stones.iter().map(of_stone).collect();
        let of_unknowns: BTreeMap<usize, SMatrix<f64, 6, 3>> = rigid.of_unknowns().collect();
        let rigidly = |unknown: usize, stone: usize| match of_unknowns.get(&unknown) {
            Some(by) => rigid.lever(&pair.stones[stone].centroid) * by,
            None => Matrix3::zeros(),
        };
        Self {
            of_motions: match &pair.response {
                Some(response) => response.of(&of_points, rigidly),
                None => of_points.clone(),
            },
            of_points,
        }
    }

    /// The error of the motion of the second of two neighbours less that of the first.
    pub fn between(&self, [first, second]: &[usize; 2]) -> Row {
        let less = self.of_motions[*first].iter().map(|(k, m)| (*k, -m));
        self.of_motions[*second].iter().copied().chain(less).collect()
    }
}
