//! Matching, step by step.

use super::MatchParams;
use super::centroids::{Centroids, area_ratio};
use super::field::predict;
use super::shift::common_shift;
use crate::id::StoneId;
use crate::stone::{MatchOutcome, Stone, UnmatchedReason};
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Overlap of two stones, 0..1, after the first is moved by the shift; `None` where it is unknown, as by
/// [`footprint_overlap`](super::footprint_overlap).
pub type Overlap<'a> = dyn Fn(&Stone, &Stone, &Vector3<f64>) -> Option<f64> + Sync + 'a;

/// Nearest stones of the second epoch whose overlap is computed.
const OVERLAP_CANDIDATES: usize = 5;

/// What matching takes beside the two tables of stones.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    /// Whether the second epoch has points, and photos that see them, at a place.
    pub covered: &'a (dyn Fn(&Point3<f64>) -> bool + Sync),
    /// Overlap of the stones' surfaces: pairs stones that centroids and areas leave alone.
    pub overlap: Option<&'a Overlap<'a>>,
}

/// How well a pair fits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MatchQuality {
    /// Stone of the first epoch.
    pub first: StoneId,
    /// Stone of the second epoch nearest to where the first is expected.
    pub nearest: StoneId,
    /// Distance of their centroids after the local shift, metres.
    pub distance_m: f64,
    /// That distance over the one to the second nearest (Equation 2); 0 where there is no second.
    pub ratio: f64,
    /// Smaller over larger face area.
    pub area_ratio: f64,
}

/// The outcome for every stone of both epochs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MatchReport {
    /// One entry a stone of the first epoch, ascending by id.
    pub outcomes: Vec<(StoneId, MatchOutcome)>,
    /// The nearest candidate of each stone of the first epoch, matched or not, ascending by id; empty without
    /// candidates.
    pub qualities: Vec<MatchQuality>,
    /// Stones of the second epoch without a partner, ascending: new, or seen in the second epoch only.
    pub unmatched_second: Vec<StoneId>,
    /// The shift from which the local shifts grew, metres.
    pub common_shift: Vector3<f64>,
    /// Expected displacement at each stone of the first epoch, in their order: the neighbours' median,
    /// metres.
    pub local_shifts: Vec<Vector3<f64>>,
}

/// Pairs the stones of two epochs.
///
/// A stone's partner is the nearest centroid to where the local shift expects it, if that is much nearer than
/// the second nearest (ratio test, Equation 2 of the paper, after Lowe 2004), the faces are about equally
/// large, and each is the other's nearest. Of the stones that are left, those whose surfaces overlap are
/// paired, best first, where the caller can tell the overlap. No stone is used twice. The result does not
/// depend on the order of the tables. Cost: a few nearest-neighbour searches a stone for each of about a
/// dozen trial shifts.
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use stonewise_core::matching::{MatchParams, Surroundings, match_stones};
/// use stonewise_core::{id::StoneId, stone::MatchOutcome, stone::Stone};
///
/// // Stones in courses of unequal length; in the second epoch they lie 2 cm lower and have other numbers.
/// let wall = |first_id: u32, lower: f64| -> Vec<Stone> {
///     let stone = |k: u32| Stone {
///         id: StoneId(first_id + k),
///         centroid: Point3::new(0.0, 0.3 * f64::from(k % 6) + 0.03 * f64::from(k * k % 7), 0.2 * f64::from(k / 6) - lower),
///         normal: Vector3::x(),
///         area_m2: 0.04 + 0.002 * f64::from(k % 5),
///         points: 400,
///         photos: 3,
///         confidence: 1.0,
///     };
///     (0..24).map(stone).collect()
/// };
/// let surroundings = Surroundings { covered: &|_| true, overlap: None };
/// let report = match_stones(&wall(1, 0.0), &wall(101, 0.02), &surroundings, &MatchParams::default());
/// assert_eq!(report.outcomes[3], (StoneId(4), MatchOutcome::Matched { second: StoneId(104) }));
/// assert!((report.local_shifts[3].z + 0.02).abs() < 1e-9);
/// ```
pub fn match_stones(
    first: &[Stone],
    second: &[Stone],
    surroundings: &Surroundings,
    params: &MatchParams,
) -> MatchReport {
    let sorted = |stones: &[Stone]| {
        let mut stones = stones.to_vec();
        stones.sort_by_key(|s| s.id);
        stones
    };
    let (first, second) = (sorted(first), sorted(second));
    let (a, b) = (Centroids::new(&first), Centroids::new(&second));
    let (common_shift, field) = common_shift(&a, &b, params);
    let places = predict(&first, &field.shifts);
    let sides = Sides {
        back: Centroids::at(&first, &places),
        first: a,
        second: b,
    };

    let trials: Vec<Trial> = (0..first.len())
        .map(|i| try_one(i, &places[i], &sides, surroundings, params))
        .collect();
    let mut outcomes = one_to_one(&first, &second, &trials);
    if let Some(overlap) = surroundings.overlap {
        pair_by_overlap(&mut outcomes, &sides, &places, &field.shifts, overlap, params);
    }
    let mut used: Vec<StoneId> = outcomes.iter().filter_map(|o| partner(&o.1)).collect();
    used.sort_unstable();

    MatchReport {
        unmatched_second: second
            .iter()
            .map(|s| s.id)
            .filter(|id| used.binary_search(id).is_err())
            .collect(),
        outcomes,
        qualities: trials.iter().filter_map(|t| t.quality).collect(),
        common_shift,
        local_shifts: field.shifts,
    }
}

/// One stone's attempt: the accepted candidate, or the reason why there is none.
struct Trial {
    outcome: Result<usize, UnmatchedReason>,
    quality: Option<MatchQuality>,
}

/// The stones of both epochs, to be searched by place.
struct Sides<'a> {
    first: Centroids<'a>,
    second: Centroids<'a>,
    /// Stones of the first epoch where the second is expected to show them.
    back: Centroids<'a>,
}

fn try_one(
    i: usize,
    place: &Point3<f64>,
    Sides { first, second, back }: &Sides,
    surroundings: &Surroundings,
    params: &MatchParams,
) -> Trial {
    let stone = &first.stones[i];
    let absent = || {
        if (surroundings.covered)(place) {
            UnmatchedReason::Lost
        } else {
            UnmatchedReason::Unseen
        }
    };

    let near = second.nearest(place, 2);
    let Some(&(j, distance_m)) = near.first() else {
        return Trial {
            outcome: Err(absent()),
            quality: None,
        };
    };
    let candidate = &second.stones[j];
    let quality = MatchQuality {
        first: stone.id,
        nearest: candidate.id,
        distance_m,
        ratio: near
            .get(1)
            .map_or(0.0, |n| distance_m / n.1.max(f64::MIN_POSITIVE)),
        area_ratio: area_ratio(stone, candidate),
    };

    let mutual = || back.nearest(&candidate.centroid, 1).first().map(|n| n.0) == Some(i);
    let outcome = if distance_m > params.max_offset_m(stone.area_m2.max(candidate.area_m2)) {
        Err(absent())
    } else if quality.area_ratio < params.min_area_ratio {
        Err(UnmatchedReason::AreaMismatch)
    } else if quality.ratio >= params.max_ratio || (params.mutual && !mutual()) {
        Err(UnmatchedReason::Ambiguous)
    } else {
        Ok(j)
    };

    Trial {
        outcome,
        quality: Some(quality),
    }
}

/// Where several stones claim the same partner, the nearest has it.
fn one_to_one(first: &[Stone], second: &[Stone], trials: &[Trial]) -> Vec<(StoneId, MatchOutcome)> {
    let mut holder: Vec<Option<(f64, usize)>> = vec![None; second.len()];
    for (i, trial) in trials.iter().enumerate() {
        if let (Ok(j), Some(quality)) = (trial.outcome, trial.quality) {
            let claim = (quality.distance_m, i);
            if holder[j].is_none_or(|h| claim < h) {
                holder[j] = Some(claim);
            }
        }
    }
    first
        .iter()
        .zip(trials)
        .enumerate()
        .map(|(i, (stone, trial))| {
            let outcome = match trial.outcome {
                Ok(j) if holder[j].is_some_and(|h| h.1 == i) => {
                    MatchOutcome::Matched { second: second[j].id }
                }
                Ok(_) => MatchOutcome::Unmatched(UnmatchedReason::Ambiguous),
                Err(reason) => MatchOutcome::Unmatched(reason),
            };
            (stone.id, outcome)
        })
        .collect()
}

/// Pairs stones that are left over where their surfaces overlap, the best overlap first.
fn pair_by_overlap(
    outcomes: &mut [(StoneId, MatchOutcome)],
    Sides { first, second, .. }: &Sides,
    places: &[Point3<f64>],
    shifts: &[Vector3<f64>],
    overlap: &Overlap,
    params: &MatchParams,
) {
    let mut used: BTreeSet<StoneId> = outcomes.iter().filter_map(|o| partner(&o.1)).collect();
    let mut found: Vec<(f64, usize, usize)> = Vec::new();
    for i in (0..outcomes.len()).filter(|&i| partner(&outcomes[i].1).is_none()) {
        for (j, _) in second.nearest(&places[i], OVERLAP_CANDIDATES) {
            let value = overlap(&first.stones[i], &second.stones[j], &shifts[i]);
            if let Some(value) = value.filter(|v| params.min_overlap.is_some_and(|least| *v >= least)) {
                found.push((value, i, j));
            }
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
    for (_, i, j) in found {
        let second = second.stones[j].id;
        if partner(&outcomes[i].1).is_none() && used.insert(second) {
            outcomes[i].1 = MatchOutcome::Matched { second };
        }
    }
}

fn partner(outcome: &MatchOutcome) -> Option<StoneId> {
    match outcome {
        MatchOutcome::Matched { second } => Some(*second),
        MatchOutcome::Unmatched(_) => None,
    }
}
