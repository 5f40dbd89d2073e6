//! From what was measured to the verdict.

use super::area::area;
use super::case::{Case, JointCase, StoneCase, StoneMeasured, TimeCase};
use super::interval::{Estimate, QUANTILE};
use super::judged::{
    Compared, FALSE_DISCOVERY_RATE, Finding, Judged, JudgedJoint, JudgedStone, Outcome, millimetres,
};
use super::sentence::{reasons, sentence};
use crate::texts::Texts;
use nalgebra::Point2;
use stonewise_base::thresholds::{Level, Quantity, Thresholds, Zone};
use stonewise_core::statistics::q_values;
use stonewise_results::records::{EpochVerdict, JointVerdict, State, StoneVerdict, ZoneVerdict};

/// The verdict on a pair of epochs.
pub(crate) fn assess(case: &Case, thresholds: &Thresholds, texts: &'static Texts) -> EpochVerdict {
    let judged = judge(case, thresholds);
    let whole = area(case, thresholds, &judged, None);
    let zone = |(number, zone): (usize, &Zone)| ZoneVerdict {
        name: zone.name.clone(),
        area: area(case, thresholds, &judged, Some(number)),
    };
    let zones = thresholds.zones().iter().enumerate().map(zone).collect();
    EpochVerdict {
        epoch: case.epochs[1].clone(),
        reference: case.epochs[0].clone(),
        datum: case.datum,
        state: whole.state,
        sentence: sentence(case, thresholds, &judged, &whole, texts),
        reasons: reasons(case, thresholds, &judged, &whole, texts),
        wall: whole,
        zones,
        deformation: judged.deformation.clone(),
        joints: noted(&judged, thresholds),
        stones: judged.stones.into_iter().map(|s| s.verdict).collect(),
    }
}

/// States of all stones, joints and zones of deformation.
fn judge(case: &Case, thresholds: &Thresholds) -> Judged {
    let mut findings = Vec::new();
    let p = |s: &StoneCase| s.measured.map(|m| m.motion.p_value());
    let p_values: Vec<f64> = case.stones.iter().filter_map(p).collect();
    let mut q = q_values(&p_values).into_iter();
    let stone = |s: &StoneCase| {
        let q = s.measured.and_then(|_| q.next());
        judge_stone(case, s, q, thresholds, &mut findings)
    };
    let stones = case.stones.iter().map(stone).collect();
    let p = |j: &JointCase| Estimate::p_value_of(j.opening_m, j.sigma_m);
    let q = q_values(&case.joints.iter().map(p).collect::<Vec<f64>>());
    let joint = |(j, q)| judge_joint(case, j, q, thresholds, &mut findings);
    let joints = case.joints.iter().zip(q).map(joint).collect();
    let deformation = case.deformation.clone().map(|mut found| {
        for zone in &mut found.zones {
            let place = thresholds.zone_at(&Point2::new(zone.along_m, zone.up_m));
            let compared = Compared {
                interval: zone.interval_mm,
                moved: true,
            };
            let finding = Finding::of(Quantity::Deformation, place, Some(compared), thresholds);
            findings.extend(finding);
            zone.state = match finding {
                _ if !case.is_sound() => State::CannotTell,
                Some(finding) => finding.outcome.state(),
                None if thresholds.is_empty() => State::Attention,
                None => State::Fine,
            };
            zone.decided_by = finding.filter(|_| case.is_sound()).and_then(|f| f.decision());
        }
        found
    });

    Judged {
        stones,
        joints,
        deformation,
        findings,
    }
}

fn judge_stone(
    case: &Case,
    stone: &StoneCase,
    q: Option<f64>,
    thresholds: &Thresholds,
    findings: &mut Vec<Finding>,
) -> JudgedStone {
    let zone = thresholds.zone_at(&stone.place);
    // Of a run in doubt no stone can be named.
    let sound = case.is_sound();
    let mut verdict = StoneVerdict {
        stone_id: stone.stone_id,
        zone: zone.map(|z| thresholds.zones()[z].name.clone()),
        lost: stone.lost,
        q: q.map(|q| significant_digits(q, 3)),
        ..StoneVerdict::default()
    };
    let mut own: Vec<Finding> = Vec::new();

    if let Some(measured) = &stone.measured {
        let moved = q.is_some_and(|q| q <= FALSE_DISCOVERY_RATE) && case.may_have_moved(measured);
        let compared = |quantity| compared(case, stone, measured, moved, quantity);
        let finding = |quantity| Finding::of(quantity, zone, compared(quantity)?, thresholds);
        own = Quantity::ALL.into_iter().filter_map(finding).collect();
        verdict.moved = moved && sound;
        verdict.loose = measured.loose && sound;
        verdict.above_limit = measured.above_limit;
        verdict.length_mm = Some(millimetres(measured.motion.vector.norm()));
        verdict.interval_mm = finite(measured.motion.length_interval());
        verdict.neighbours_mm = Some(millimetres(measured.neighbours.vector.norm()));
        verdict.neighbours_interval_mm = finite(measured.neighbours.length_interval());
    }

    let worst = own
        .iter()
        .copied()
        .reduce(|a, b| if b.outcome > a.outcome { b } else { a });
    let decided = worst.filter(|w| sound && w.outcome > Outcome::Below);
    verdict.state = stone_state(case, stone, &verdict, decided, thresholds, zone);
    verdict.decided_by = decided
        .filter(|d| d.outcome.state() == verdict.state)
        .and_then(|d| d.decision());
    findings.extend_from_slice(&own);
    JudgedStone {
        verdict,
        zone,
        detection_limit_m: stone.measured.map(|m| m.detection_limit_m),
        reaches: own.iter().any(|f| f.outcome == Outcome::Reaches),
        apparent_alarm: worst.is_some_and(|w| w.outcome == Outcome::Beyond(Level::Alarm)),
    }
}

/// What is compared with the thresholds of a quantity for a measured stone. The outer `None`: nothing is to be
/// compared; the inner: what is to be compared is not known.
fn compared(
    case: &Case,
    stone: &StoneCase,
    measured: &StoneMeasured,
    moved: bool,
    quantity: Quantity,
) -> Option<Option<Compared>> {
    let of = |interval_m: [f64; 2], moved| {
        Some(Compared {
            interval: interval_m.map(|m| 1e3 * m),
            moved,
        })
    };
    let component = |axis| Some(of(measured.motion.component_interval(axis), moved));
    match (quantity, case.time) {
        (Quantity::Length, _) => Some(of(measured.motion.length_interval(), moved)),
        (Quantity::Along, _) => component(0),
        (Quantity::Up, _) => component(1),
        (Quantity::Out, _) => component(2),
        (Quantity::Neighbours, _) => Some(of(measured.neighbours.length_interval(), measured.loose)),
        (Quantity::Rate, TimeCase::Pair(years)) => Some(years.and_then(|years| {
            let interval_m = measured.motion.length_interval();
            of(interval_m.map(|m| m / years), moved)
        })),
        (Quantity::Rate, TimeCase::Newest) => Some(stone.rate),
        (Quantity::Departure, TimeCase::Pair(_) | TimeCase::Newest) => Some(stone.departure),
        (Quantity::Rate | Quantity::Departure, TimeCase::Earlier) => None,
        (Quantity::Joints | Quantity::Deformation, _) => None,
    }
}

fn stone_state(
    case: &Case,
    stone: &StoneCase,
    verdict: &StoneVerdict,
    decided: Option<Finding>,
    thresholds: &Thresholds,
    zone: Option<usize>,
) -> State {
    let state = decided.map_or(State::Fine, |d| d.outcome.state());
    let shown = thresholds.is_empty() && (verdict.moved || verdict.loose);
    // A motion that all stones share would reach the thresholds unseen.
    let datum_is_missing = !case.has_datum() && case.needs_datum(thresholds, zone);
    if !case.is_sound() {
        State::CannotTell
    } else if stone.lost || shown {
        state.max(State::Attention)
    } else if stone.measured.is_none() || datum_is_missing {
        state.max(State::CannotTell)
    } else {
        state
    }
}

fn judge_joint(
    case: &Case,
    joint: &JointCase,
    q: f64,
    thresholds: &Thresholds,
    findings: &mut Vec<Finding>,
) -> JudgedJoint {
    let zone = thresholds.zone_at(&joint.place);
    let half = QUANTILE * joint.sigma_m;
    let interval_mm = [joint.opening_m - half, joint.opening_m + half].map(|m| 1e3 * m);
    let compared = Compared {
        interval: interval_mm,
        moved: q <= FALSE_DISCOVERY_RATE,
    };
    let finding = Finding::of(Quantity::Joints, zone, Some(compared), thresholds);
    findings.extend(finding);
    let state = match finding {
        _ if !case.is_sound() => State::CannotTell,
        Some(finding) => finding.outcome.state(),
        None => State::Fine,
    };
    JudgedJoint {
        verdict: JointVerdict {
            stones: joint.stones,
            state,
            decided_by: finding.filter(|_| case.is_sound()).and_then(|f| f.decision()),
            opening_mm: millimetres(joint.opening_m),
            interval_mm: interval_mm.map(|mm| millimetres(mm / 1e3)),
            q: significant_digits(q, 3),
        },
        zone,
        opened: compared.moved && joint.opening_m > 0.0,
        reaches: finding.is_some_and(|f| f.outcome > Outcome::Below),
    }
}

/// Joints that are not below their thresholds, where joints have any.
fn noted(judged: &Judged, thresholds: &Thresholds) -> Vec<JointVerdict> {
    let asked = thresholds.has(Quantity::Joints);
    let worth = |j: &&JudgedJoint| asked && (j.opened || j.reaches);
    let finite = |j: &JudgedJoint| j.verdict.interval_mm.iter().all(|v| v.is_finite());
    judged
        .joints
        .iter()
        .filter(worth)
        .filter(|j| finite(j))
        .map(|j| j.verdict)
        .collect()
}

/// An interval in millimetres, where it is one.
fn finite(interval_m: [f64; 2]) -> Option<[f64; 2]> {
    interval_m
        .iter()
        .all(|v| v.is_finite())
        .then(|| interval_m.map(millimetres))
}

/// A number with this many digits.
fn significant_digits(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits.saturating_sub(1))
        .parse()
        .unwrap_or(value)
}
