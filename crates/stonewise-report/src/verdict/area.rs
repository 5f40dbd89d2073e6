//! The state and the numbers of the wall or of a zone.

use super::case::Case;
use super::judged::{Finding, Judged, JudgedStone, Outcome, millimetres};
use std::collections::BTreeMap;
use stonewise_base::thresholds::{Level, Quantity, Thresholds};
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
        decided_by: reasons
            .first()
            .and_then(|r| judged.findings_in(zone).find(|f| gives(f, *r))?.decision()),
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
        R::Alarm(_) => State::Alarm,
        R::Attention(_) | R::StonesLost | R::MotionShown | R::DeformationShown => State::Attention,
        R::BelowThresholds | R::NoMotionShown => State::Fine,
        R::NotConverged
        | R::InDoubt
        | R::NothingMeasured
        | R::FewMeasured
        | R::DatumUnknown
        | R::NotJudged(_)
        | R::IntervalReachesThreshold
        | R::DeformationReachesThreshold => State::CannotTell,
    }
}

/// Whether a finding is one of those that a reason names.
pub(super) fn gives(finding: &Finding, reason: ReasonCode) -> bool {
    use ReasonCode as R;
    let is = |quantity, outcome| finding.quantity == quantity && finding.outcome == outcome;
    match reason {
        R::Alarm(quantity) => is(quantity, Outcome::Beyond(Level::Alarm)),
        R::Attention(quantity) => is(quantity, Outcome::Beyond(Level::Attention)),
        R::NotJudged(quantity) => is(quantity, Outcome::NotJudged),
        R::DeformationReachesThreshold => is(Quantity::Deformation, Outcome::Reaches),
        R::IntervalReachesThreshold => {
            finding.quantity != Quantity::Deformation && finding.outcome == Outcome::Reaches
        }
        _ => false,
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
    let found = |reason: R| (judged.findings_in(zone).any(|f| gives(f, reason)), reason);
    let without = thresholds.is_empty();
    let measured = stones().filter(|s| s.verdict.length_mm.is_some()).count();
    let share = measured as f64 / stones().count().max(1) as f64;
    let datum_matters = stones().any(|s| case.needs_datum(thresholds, s.zone));
    let shown = stones().any(|s| s.verdict.moved || s.verdict.loose);
    let deformed = zone.is_none() && !judged.deformed_zones().is_empty();
    let not_judged = |quantity| {
        let asked = judged.findings_in(zone).filter(|f| f.quantity == quantity);
        let missing = asked.clone().filter(|f| f.outcome == Outcome::NotJudged).count();
        (
            missing as f64 > LEAST_MEASURED * asked.count() as f64,
            R::NotJudged(quantity),
        )
    };

    let mut all = vec![(case.not_converged, R::NotConverged), (case.in_doubt, R::InDoubt)];
    all.extend(Quantity::ALL.map(|q| found(R::Alarm(q))));
    all.extend(Quantity::ALL.map(|q| found(R::Attention(q))));
    all.extend([
        (without && shown, R::MotionShown),
        (without && deformed, R::DeformationShown),
        (stones().any(|s| s.verdict.lost), R::StonesLost),
        (measured == 0, R::NothingMeasured),
        (measured > 0 && share < LEAST_MEASURED, R::FewMeasured),
        (datum_matters && !case.has_datum(), R::DatumUnknown),
    ]);
    all.extend([Quantity::Rate, Quantity::Departure].map(not_judged));
    all.extend([R::IntervalReachesThreshold, R::DeformationReachesThreshold].map(found));

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
