//! Results against the truth of a simulated survey.

use crate::cloud::GridIndex;
use crate::evaluate::detection::share;
use crate::evaluate::{EvaluationParams, MotionSample, MotionScore, StoneOutcome, score_motions};
use crate::id::StoneId;
use nalgebra::{Point3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A simulated stone and how it truly moved, rigidly.
#[derive(Clone, Debug, PartialEq)]
pub struct TrueStone {
    /// Number of the stone in the truth.
    pub stone_id: StoneId,
    /// Centroid in epoch 1, world frame, metres.
    pub centroid: Point3<f64>,
    /// Outward normal of the wall's face.
    pub normal: Vector3<f64>,
    /// Displacement of that centroid, metres.
    pub displacement: Vector3<f64>,
    /// Rotation vector, radians.
    pub rotation: Vector3<f64>,
    /// Moves unlike its neighbours.
    pub loose: bool,
    /// Cut by the end of the section.
    pub edge: bool,
    /// Share of its face that is measured in both epochs, 0..1.
    pub visible_share: f64,
}

/// A row of results, and the true stone that it belongs to; `None` where there is none.
pub type Owned = (StoneOutcome, Option<StoneId>);

/// Results against truth, missing stones included.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TruthScore {
    /// Stones that count: visible enough in both epochs and not at the edge.
    pub countable: usize,
    /// Countable stones with a displacement.
    pub found: usize,
    /// `found` / `countable`.
    pub found_share: Option<f64>,
    /// Countable stones to which no result row belongs.
    pub without_row: Vec<StoneId>,
    /// Countable stones whose row has no displacement.
    pub without_motion: Vec<StoneId>,
    /// Further rows of stones that have one already; the row nearest to the true centroid counts.
    pub duplicate_rows: usize,
    /// Rows that belong to no true stone.
    pub foreign_rows: usize,
    /// Errors of the countable stones found.
    pub motions: MotionScore,
}

impl TrueStone {
    /// Whether the stone is scored.
    pub fn is_countable(&self, params: &EvaluationParams) -> bool {
        !self.edge && self.visible_share >= params.min_visible_share
    }

    /// True displacement of a point that was at `p` and belongs to the stone.
    pub fn displacement_at(&self, p: &Point3<f64>) -> Vector3<f64> {
        let arm = p - self.centroid;
        self.displacement + Rotation3::from_scaled_axis(self.rotation) * arm - arm
    }
}

/// The rows with their owners: the true stone whose centroid is nearest, within `owner_reach_m`.
pub fn owned_by_nearest(
    outcomes: Vec<StoneOutcome>,
    stones: &[TrueStone],
    params: &EvaluationParams,
) -> Vec<Owned> {
    let index = GridIndex::new(&stones.iter().map(|s| s.centroid).collect::<Vec<_>>(), 0.2);
    let owner = |outcome: &StoneOutcome| index.nearest(&outcome.centroid, params.owner_reach_m);
    let owned = outcomes.into_iter().map(|outcome| {
        let owner = owner(&outcome).map(|(i, _)| stones[i].stone_id);
        (outcome, owner)
    });
    owned.collect()
}

/// Scores result rows against a simulated survey.
///
/// The truth of a row is the rigid motion of its owner, evaluated at the row's centroid; directions are those
/// of the true face. Loose stones are compared where both sides say.
pub fn score_against_truth(
    outcomes: &[Owned],
    stones: &[TrueStone],
    params: &EvaluationParams,
) -> TruthScore {
    let Rows {
        of_stone: rows,
        duplicates: duplicate_rows,
        foreign: foreign_rows,
    } = Rows::new(outcomes, stones);
    let by_id: BTreeMap<StoneId, &TrueStone> = stones.iter().map(|s| (s.stone_id, s)).collect();
    let countable: Vec<&TrueStone> = by_id.into_values().filter(|s| s.is_countable(params)).collect();
    let (mut without_row, mut without_motion, mut samples) = (Vec::new(), Vec::new(), Vec::new());

    for stone in &countable {
        let Some(row) = rows.get(&stone.stone_id) else {
            without_row.push(stone.stone_id);
            continue;
        };
        let truth = stone.displacement_at(&row.centroid);
        match MotionSample::of_stone(row, &stone.normal, truth, Some(stone.loose)) {
            Some(sample) => samples.push(sample),
            None => without_motion.push(stone.stone_id),
        }
    }

    TruthScore {
        countable: countable.len(),
        found: samples.len(),
        found_share: share(samples.len(), countable.len()),
        without_row,
        without_motion,
        duplicate_rows,
        foreign_rows,
        motions: score_motions(&samples, countable.len(), params),
    }
}

/// Which row of the results counts for each true stone.
pub(super) struct Rows<'a> {
    /// By number of the true stone: the row whose centroid is nearest to the true one.
    pub of_stone: BTreeMap<StoneId, &'a StoneOutcome>,
    /// Further rows of these stones.
    duplicates: usize,
    /// Rows that belong to no true stone.
    foreign: usize,
}

impl<'a> Rows<'a> {
    pub(super) fn new(outcomes: &'a [Owned], stones: &[TrueStone]) -> Self {
        let by_id: BTreeMap<StoneId, &TrueStone> = stones.iter().map(|s| (s.stone_id, s)).collect();
        let mut rows = Self {
            of_stone: BTreeMap::new(),
            duplicates: 0,
            foreign: 0,
        };
        for (outcome, owner) in outcomes {
            let Some(stone) = owner.and_then(|id| by_id.get(&id)) else {
                rows.foreign += 1;
                continue;
            };
            let off = |o: &StoneOutcome| (o.centroid - stone.centroid).norm_squared();
            match rows.of_stone.get_mut(&stone.stone_id) {
                None => {
                    rows.of_stone.insert(stone.stone_id, outcome);
                }
                Some(kept) => {
                    rows.duplicates += 1;
                    if off(outcome) < off(kept) {
                        *kept = outcome;
                    }
                }
            }
        }
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stone(stone_id: u32, y: f64) -> TrueStone {
        TrueStone {
            stone_id: StoneId(stone_id),
            centroid: Point3::new(0.0, y, 0.0),
            normal: Vector3::x(),
            displacement: Vector3::new(0.01, 0.0, 0.0),
            rotation: Vector3::new(0.0, 0.0, 0.02),
            loose: stone_id == 2,
            edge: stone_id == 4,
            visible_share: if stone_id == 5 { 0.2 } else { 0.9 },
        }
    }

    fn row(y: f64, displacement: Option<Vector3<f64>>) -> StoneOutcome {
        StoneOutcome {
            stone: StoneId(7),
            centroid: Point3::new(0.0, y, 0.0),
            normal: Vector3::x(),
            displacement,
            covariance: None,
            covariance_without_datum: None,
            rotation: None,
            datum_known: true,
            detection_limit_m: None,
            significant: None,
            loose: Some(true),
        }
    }

    #[test]
    fn truth_turns_with_the_stone() {
        // 5 cm from the centroid along y, a turn of 0.02 rad about z moves by -0.05 sin 0.02 in x.
        let d = stone(1, 0.0).displacement_at(&Point3::new(0.0, 0.05, 0.0));
        assert!((d.x - (0.01 - 0.05 * 0.02f64.sin())).abs() < 1e-15);
        assert!((d.y - 0.05 * (0.02f64.cos() - 1.0)).abs() < 1e-15);
    }

    #[test]
    fn every_stone_and_every_row_is_accounted_for() {
        let params = EvaluationParams::default();
        let stones: Vec<_> = (1..=6).map(|id| stone(id, f64::from(id))).collect();
        let d = Some(Vector3::new(0.01, 0.0, 0.0));
        let rows = vec![
            row(1.04, Some(Vector3::zeros())),
            row(1.01, d),
            row(2.0, d),
            row(3.02, None),
            row(4.0, d),
            row(9.0, d),
        ];
        let rows = owned_by_nearest(rows, &stones, &params);
        let owners: Vec<u32> = rows.iter().map(|r| r.1.map_or(0, |id| id.0)).collect();
        assert_eq!(owners, [1, 1, 2, 3, 4, 0]);
        let score = score_against_truth(&rows, &stones, &params);
        assert_eq!((score.countable, score.found), (4, 2));
        assert_eq!(
            (score.without_row, score.without_motion),
            (vec![StoneId(6)], vec![StoneId(3)])
        );
        assert_eq!((score.duplicate_rows, score.foreign_rows), (1, 1));
        let loose = score.motions.loose.unwrap();
        assert_eq!((loose.reported, loose.truly_loose, loose.right), (2, 1, 1));
        // The row at 1.01 counts: off by the turn over 1 cm.
        assert!(score.motions.errors.norm_3d.unwrap().rmse_m < 2e-4);
    }
}
