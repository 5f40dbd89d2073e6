//! Stones that something covers in one of the epochs.

use super::state::{Adjustment, StoneState};
use crate::statistics::upper_median;
use crate::stone::{MotionFailure, PairResult};
use crate::switches::switchable;
use std::collections::BTreeMap;

/// Mean distance of a stone's points from the joint surface, in units of the usual one, beyond which something covers
/// the stone in one of the epochs.
const COVERED: f64 = 4.0;
/// Fewest stones of which the usual distance is known.
const LEAST_OF_USUAL: usize = 8;

/// Which stones something covers in one of the epochs: ivy, snow, a net. Their points lie several times as far from the
/// joint surface as those of other stones, and the motion would be that of what covers them.
pub(super) fn covered(adjustment: &Adjustment) -> Vec<bool> {
    switchable!("covered", vec![false; adjustment.stones.len()]);
    let distance = |stone: &StoneState| {
        let equations = stone.more_probable().surface.equations()?;
        Some([0, 1].map(|epoch| equations.distances[epoch] / equations.points[epoch] as f64))
    };
    let distances: Vec<Option<[f64; 2]>> = adjustment.stones.iter().map(distance).collect();
    let usual = |epoch: usize| {
        let mut all: Vec<f64> = distances.iter().flatten().map(|s| s[epoch]).collect();
        all.retain(|s| s.is_finite());
        upper_median(&mut all).filter(|_| all.len() >= LEAST_OF_USUAL)
    };
    let limits = [0, 1].map(|epoch| usual(epoch).map_or(f64::INFINITY, |usual| COVERED * usual));
    let is_covered = |distance: &[f64; 2]| (0..2).any(|epoch| distance[epoch] > limits[epoch]);
    distances
        .iter()
        .map(|s| s.as_ref().is_some_and(is_covered))
        .collect()
}

/// Refuses all stones of a part of the wall of which half or more are covered, and counts none of these as a part that
/// moved: a crack around what covers them is no crack of the wall.
pub(super) fn leave_out_covered(covered: &[bool], results: &mut [PairResult]) {
    let mut parts: BTreeMap<u32, [usize; 2]> = BTreeMap::new();
    for (result, covered) in results.iter().zip(covered) {
        let [all, hidden] = parts.entry(result.body).or_default();
        *all += 1;
        *hidden += usize::from(*covered);
    }
    for (result, covered) in results.iter_mut().zip(covered) {
        let is_hidden = result.body > 1
            && parts
                .get(&result.body)
                .is_some_and(|[all, hidden]| 2 * hidden >= *all);
        if *covered || is_hidden {
            result.body = 0;
            result.motion = Err(MotionFailure::Disagreement);
        }
    }
}
