//! The state and the numbers of the wall or of a zone.

use super::case::Case;
use super::judged::{Judged, JudgedStone, Level, deformed, millimetres};
use std::collections::BTreeMap;
use stonewise_base::thresholds::Thresholds;
use stonewise_results::Sorted;
use stonewise_results::records::{Area, DetectionLimit, Largest, ReasonCode, State};

/// A wall of which less than this share was measured is never called fine.
const LEAST_MEASURED: f64 = 0.5;

/// The numbers of a zone, or of the wall, and the state that follows from them.
pub(super) fn area(case: &Case, thresholds: &Thresholds, judged: &Judged, zone: Option<usize>) -> Area {
    let stones = || judged.stones_in(zone);
    let count = |keep: fn(&JudgedStone) -> bool| stones().filter(|s| keep(s)).count();
    let largest = |size: fn(&JudgedStone) -> Option<Largest>| {
        let all = stones().filter_map(size);
        all.max_by(|a, b| a.length_mm.total_cmp(&b.length_mm))
    };
    let mut by_state = BTreeMap::new();

    for state in State::WORST_FIRST {
        let n = stones().filter(|s| s.verdict.state == state).count();
        by_state.insert(state.word().to_owned(), n);
    }

    let opened = judged.joints_in(zone).filter(|j| j.opened);
    let widest = opened.max_by(|a, b| a.verdict.opening_mm.total_cmp(&b.verdict.opening_mm));
    let limits = Sorted::new(stones().filter_map(|s| s.detection_limit_m));
    let limit = |share: f64| limits.quantile(share).map(millimetres);
    let q = stones().filter_map(|s| s.verdict.q);
    let reasons = reason_codes(case, thresholds, judged, zone);

    Area {
        state: reasons.first().map_or(State::CannotTell, |r| state_of(*r)),
        reasons,
        stones: stones().count(),
        measured: count(|s| s.verdict.length_mm.is_some()),
        above_limit: count(|s| s.verdict.above_limit),
        moved: count(|s| s.verdict.moved),
        loose: count(|s| s.verdict.loose),
        lost: count(|s| s.verdict.lost),
        by_state,
        smallest_q: q.min_by(f64::total_cmp),
        largest: largest(|s| {
            largest_of(
                s.verdict.moved,
                s.verdict.stone_id,
                s.verdict.length_mm,
                s.verdict.interval_mm,
            )
        }),
        largest_against_neighbours: largest(|s| {
            let v = &s.verdict;
            largest_of(v.loose, v.stone_id, v.neighbours_mm, v.neighbours_interval_mm)
        }),
        largest_opening: widest.map(|j| j.verdict),
        detection_limit: limit(0.5)
            .zip(limit(0.9))
            .map(|(median_mm, percentile_90_mm)| DetectionLimit {
                median_mm,
                percentile_90_mm,
            }),
    }
}

fn largest_of(
    counts: bool,
    stone_id: u32,
    length: Option<f64>,
    interval: Option<[f64; 2]>,
) -> Option<Largest> {
    Some(Largest {
        stone_id,
        length_mm: length.filter(|_| counts)?,
        interval_mm: interval?,
    })
}

/// The state that a reason gives.
pub(super) fn state_of(reason: ReasonCode) -> State {
    use ReasonCode as R;
    match reason {
        R::LengthAlarm | R::NeighboursAlarm | R::JointsAlarm | R::DeformationAlarm => State::Alarm,
        R::LengthAttention
        | R::NeighboursAttention
        | R::JointsAttention
        | R::DeformationAttention
        | R::StonesLost
        | R::MotionShown
        | R::DeformationShown => State::Attention,
        R::BelowThresholds | R::NoMotionShown => State::Fine,
        R::NotConverged
        | R::InDoubt
        | R::NothingMeasured
        | R::FewMeasured
        | R::DatumUnknown
        | R::IntervalReachesThreshold
        | R::DeformationReachesThreshold => State::CannotTell,
    }
}

/// Every reason that applies; the first decides the state.
fn reason_codes(
    case: &Case,
    thresholds: &Thresholds,
    judged: &Judged,
    zone: Option<usize>,
) -> Vec<ReasonCode> {
    use ReasonCode as R;
    let stones = || judged.stones_in(zone);
    let joints = || judged.joints_in(zone);
    let length = |level: Level| stones().any(|s| s.length == level);
    let neighbours = |level: Level| stones().any(|s| s.neighbours == level);
    let opening = |level: Level| joints().any(|j| j.opening == level);
    let of_wall = zone.is_none();
    let deformation = |level: Level| {
        let zones = judged.deformed_zones();
        of_wall && zones.iter().any(|z| deformed(z, thresholds) == level)
    };
    let without = thresholds.is_empty();
    let measured = stones().filter(|s| s.verdict.length_mm.is_some()).count();
    let share = measured as f64 / stones().count().max(1) as f64;

    let length_matters = without
        || match zone {
            Some(_) => !thresholds.measures(zone).length.is_empty(),
            None => stones().any(|s| !thresholds.measures(s.zone).length.is_empty()),
        };
    let reaches = length(Level::Reaches) || neighbours(Level::Reaches) || opening(Level::Reaches);
    let shown = stones().any(|s| s.verdict.moved || s.verdict.loose);
    let all = [
        (case.not_converged, R::NotConverged),
        (case.in_doubt, R::InDoubt),
        (length(Level::Alarm), R::LengthAlarm),
        (neighbours(Level::Alarm), R::NeighboursAlarm),
        (opening(Level::Alarm), R::JointsAlarm),
        (deformation(Level::Alarm), R::DeformationAlarm),
        (length(Level::Attention), R::LengthAttention),
        (neighbours(Level::Attention), R::NeighboursAttention),
        (opening(Level::Attention), R::JointsAttention),
        (deformation(Level::Attention), R::DeformationAttention),
        (without && shown, R::MotionShown),
        (without && deformation(Level::NotAsked), R::DeformationShown),
        (stones().any(|s| s.verdict.lost), R::StonesLost),
        (measured == 0, R::NothingMeasured),
        (measured > 0 && share < LEAST_MEASURED, R::FewMeasured),
        (length_matters && !case.has_datum(), R::DatumUnknown),
        (reaches, R::IntervalReachesThreshold),
        (deformation(Level::Reaches), R::DeformationReachesThreshold),
    ];

    let mut codes: Vec<R> = all
        .into_iter()
        .filter(|(holds, _)| *holds)
        .map(|(_, code)| code)
        .collect();

    if codes.is_empty() {
        codes.push(if without {
            R::NoMotionShown
        } else {
            R::BelowThresholds
        });
    }

    codes
}
