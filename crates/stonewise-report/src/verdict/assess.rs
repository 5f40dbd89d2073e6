//! From what was measured to the verdict.

use super::area::area;
use super::case::{Case, JointCase, StoneCase};
use super::interval::{Estimate, QUANTILE};
use super::judged::{Judged, JudgedJoint, JudgedStone, Level, deformed, millimetres};
use super::sentence::{reasons, sentence};
use stonewise_base::report_params::Language;
use stonewise_base::thresholds::{Measures, Thresholds};
use stonewise_core::statistics::q_values;
use stonewise_results::records::{EpochVerdict, JointVerdict, State, StoneVerdict, ZoneVerdict};

/// Share of false ones that is accepted among the stones said to have moved.
const FALSE_DISCOVERY_RATE: f64 = 0.05;

/// The verdict on a pair of epochs.
pub(crate) fn assess(case: &Case, thresholds: &Thresholds, language: Language) -> EpochVerdict {
    let judged = judge(case, thresholds);
    let whole = area(case, thresholds, &judged, None);
    // As if the run were sound: what the numbers alone would say.
    let apparent = judged.apparent_alarms();
    let zones: Vec<ZoneVerdict> = (0..thresholds.zones.len())
        .map(|zone| ZoneVerdict {
            name: thresholds.zones[zone].name.clone(),
            area: area(case, thresholds, &judged, Some(zone)),
        })
        .collect();
    EpochVerdict {
        epoch: case.epochs[1].clone(),
        reference: case.epochs[0].clone(),
        datum: case.datum,
        state: whole.state,
        sentence: sentence(case, thresholds, &judged, &whole, apparent, language),
        reasons: reasons(case, thresholds, &judged, &whole, language),
        wall: whole,
        zones,
        deformation: judged.deformation.clone(),
        joints: noted(&judged, thresholds),
        stones: judged.stones.into_iter().map(|s| s.verdict).collect(),
    }
}

/// States of all stones and joints.
fn judge(case: &Case, thresholds: &Thresholds) -> Judged {
    let p = |s: &StoneCase| s.measured.map(|m| m.motion.p_value());
    let p_values: Vec<f64> = case.stones.iter().filter_map(p).collect();
    let mut q = q_values(&p_values).into_iter();
    let stone = |s: &StoneCase| {
        let q = s.measured.and_then(|_| q.next());
        judge_stone(case, s, q, thresholds)
    };
    let stones = case.stones.iter().map(stone).collect();
    let p = |j: &JointCase| Estimate::p_value_of(j.opening_m, j.sigma_m);
    let q = q_values(&case.joints.iter().map(p).collect::<Vec<f64>>());
    let joint = |(j, q)| judge_joint(case, j, q, thresholds);
    let joints = case.joints.iter().zip(q).map(joint).collect();
    let deformation = case.deformation.clone().map(|mut found| {
        for zone in &mut found.zones {
            let level = deformed(zone, thresholds);
            zone.state = match level {
                _ if !case.is_sound() => State::CannotTell,
                Level::Alarm => State::Alarm,
                Level::Attention => State::Attention,
                Level::Reaches => State::CannotTell,
                Level::NotAsked if thresholds.is_empty() => State::Attention,
                Level::Below | Level::NotAsked => State::Fine,
            };
        }
        found
    });

    Judged {
        stones,
        joints,
        deformation,
    }
}

fn judge_stone(case: &Case, stone: &StoneCase, q: Option<f64>, thresholds: &Thresholds) -> JudgedStone {
    let zone = thresholds.zone_at(&stone.place);
    let measures = thresholds.measures(zone);
    let mut judged = JudgedStone {
        verdict: StoneVerdict {
            stone_id: stone.stone_id,
            zone: zone.map(|z| thresholds.zones[z].name.clone()),
            lost: stone.lost,
            q: q.map(|q| significant_digits(q, 3)),
            ..StoneVerdict::default()
        },
        zone,
        length: Level::NotAsked,
        neighbours: Level::NotAsked,
        detection_limit_m: stone.measured.map(|m| m.detection_limit_m),
    };

    if let Some(measured) = &stone.measured {
        let moved = q.is_some_and(|q| q <= FALSE_DISCOVERY_RATE) && case.may_have_moved(measured);
        let (length, neighbours) = (
            measured.motion.length_interval(),
            measured.neighbours.length_interval(),
        );
        judged.length = Level::of(length, moved, &measures.length);
        judged.neighbours = Level::of(neighbours, measured.loose, &measures.neighbours);
        let verdict = &mut judged.verdict;
        // Of a run in doubt no stone can be named.
        let sound = case.is_sound();
        verdict.moved = moved && sound;
        verdict.loose = measured.loose && sound;
        verdict.above_limit = measured.above_limit;
        verdict.length_mm = Some(millimetres(measured.motion.vector.norm()));
        verdict.interval_mm = finite(length);
        verdict.neighbours_mm = Some(millimetres(measured.neighbours.vector.norm()));
        verdict.neighbours_interval_mm = finite(neighbours);
    }

    judged.verdict.state = stone_state(case, stone, &judged, thresholds.is_empty(), &measures);
    judged
}

fn stone_state(
    case: &Case,
    stone: &StoneCase,
    judged: &JudgedStone,
    without_thresholds: bool,
    measures: &Measures,
) -> State {
    let worst = judged.length.max(judged.neighbours);
    let shown = without_thresholds && (judged.verdict.moved || judged.verdict.loose);
    // A motion that all stones share would reach the thresholds unseen.
    let datum_matters = without_thresholds || !measures.length.is_empty();
    if !case.is_sound() {
        State::CannotTell
    } else if worst == Level::Alarm {
        State::Alarm
    } else if worst == Level::Attention || stone.lost || shown {
        State::Attention
    } else if stone.measured.is_none() || worst == Level::Reaches || (datum_matters && !case.has_datum()) {
        State::CannotTell
    } else {
        State::Fine
    }
}

fn judge_joint(case: &Case, joint: &JointCase, q: f64, thresholds: &Thresholds) -> JudgedJoint {
    let zone = thresholds.zone_at(&joint.place);
    let half = QUANTILE * joint.sigma_m;
    let interval_m = [joint.opening_m - half, joint.opening_m + half];
    let moved = q <= FALSE_DISCOVERY_RATE;
    let opening = Level::of(interval_m, moved, &thresholds.measures(zone).joints);
    let state = match opening {
        _ if !case.is_sound() => State::CannotTell,
        Level::Alarm => State::Alarm,
        Level::Attention => State::Attention,
        Level::Reaches => State::CannotTell,
        Level::Below | Level::NotAsked => State::Fine,
    };
    JudgedJoint {
        verdict: JointVerdict {
            stones: joint.stones,
            state,
            opening_mm: millimetres(joint.opening_m),
            interval_mm: interval_m.map(millimetres),
            q: significant_digits(q, 3),
        },
        zone,
        opening,
        opened: moved && joint.opening_m > 0.0,
    }
}

/// Joints that are not below their thresholds, where joints have any.
fn noted(judged: &Judged, thresholds: &Thresholds) -> Vec<JointVerdict> {
    let asked =
        !thresholds.wall.joints.is_empty() || thresholds.zones.iter().any(|z| !z.measures.joints.is_empty());
    let worth = |j: &&JudgedJoint| asked && (j.opened || j.opening > Level::Below);
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
