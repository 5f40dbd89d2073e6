//! From what was measured to the verdict.

use super::area::{Judged, area};
use super::interval::{Estimate, QUANTILE};
use super::sentence::{reasons, sentence};
use crate::report_params::Language;
use crate::results::records::{DatumState, EpochVerdict, JointVerdict, State, StoneVerdict, ZoneVerdict};
use crate::thresholds::{Levels, Measures, Thresholds};
use nalgebra::Point2;
use stonewise_core::statistics::q_values;

/// Share of false ones that is accepted among the stones said to have moved.
const FALSE_DISCOVERY_RATE: f64 = 0.05;

/// What is known of one pair of epochs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Case {
    /// Names of the first and of the later epoch.
    pub epochs: [String; 2],
    /// What the registration is known from.
    pub datum: Option<DatumState>,
    /// The estimate stopped before it settled.
    pub not_converged: bool,
    /// There is a doubt about the run as a whole.
    pub in_doubt: bool,
    /// The stones of the first epoch.
    pub stones: Vec<StoneCase>,
    /// The joints whose stones were both measured.
    pub joints: Vec<JointCase>,
}

/// What is known of a stone.
#[derive(Clone, Debug, Default)]
pub(crate) struct StoneCase {
    pub stone_id: u32,
    /// Place (along, up) in the facade frame, metres.
    pub place: Point2<f64>,
    /// The first epoch shows it well, and the later one shows its place without it.
    pub lost: bool,
    /// What was measured.
    pub measured: Option<StoneMeasured>,
}

/// The measured motion of a stone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StoneMeasured {
    /// The motion that is tested, see the stone table.
    pub motion: Estimate,
    /// The motion against the neighbours.
    pub neighbours: Estimate,
    pub above_limit: bool,
    pub loose: bool,
    pub detection_limit_m: f64,
}

/// What is known of a joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointCase {
    pub stones: [u32; 2],
    /// Its middle (along, up) in the facade frame, metres.
    pub place: Point2<f64>,
    pub opening_m: f64,
    pub sigma_m: f64,
}

impl Case {
    /// Whether the results can be relied on as a whole.
    fn is_sound(&self) -> bool {
        !self.not_converged && !self.in_doubt
    }

    /// Whether intervals hold the registration error, so that they say something about the wall as a whole.
    pub(super) fn has_datum(&self) -> bool {
        self.datum.is_some_and(|d| d != DatumState::Unknown)
    }
}

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
    Judged { stones, joints }
}

/// A stone with its state, and why.
#[derive(Clone, Debug)]
pub(super) struct JudgedStone {
    pub verdict: StoneVerdict,
    pub zone: Option<usize>,
    pub length: Level,
    pub neighbours: Level,
    pub detection_limit_m: Option<f64>,
}

/// A joint with its state, and why.
#[derive(Clone, Copy, Debug)]
pub(super) struct JudgedJoint {
    pub verdict: JointVerdict,
    pub zone: Option<usize>,
    pub opening: Level,
    pub opened: bool,
}

/// Where an interval lies among the thresholds of its quantity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Level {
    /// No threshold is given.
    #[default]
    NotAsked,
    /// Below the threshold of attention as a whole.
    Below,
    /// It reaches the threshold of attention, and does not lie beyond it.
    Reaches,
    /// Beyond the threshold of attention, of something that moved.
    Attention,
    /// Beyond the alarm threshold, of something that moved.
    Alarm,
}

impl Level {
    fn of(interval_m: [f64; 2], moved: bool, levels: &Levels) -> Self {
        let [low, high] = interval_m;
        let Some(attention) = levels.attention_m() else {
            return Self::NotAsked;
        };
        let beyond = |threshold: Option<f64>| moved && threshold.is_some_and(|t| low > t);
        if beyond(levels.alarm_m()) {
            Self::Alarm
        } else if beyond(Some(attention)) {
            Self::Attention
        } else if high < attention {
            Self::Below
        } else {
            Self::Reaches
        }
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
        let moved = q.is_some_and(|q| q <= FALSE_DISCOVERY_RATE);
        let (length, neighbours) = (
            measured.motion.length_interval(),
            measured.neighbours.length_interval(),
        );
        judged.length = Level::of(length, moved, &measures.length);
        judged.neighbours = Level::of(neighbours, measured.loose, &measures.neighbours);
        let verdict = &mut judged.verdict;
        (verdict.moved, verdict.loose, verdict.above_limit) = (moved, measured.loose, measured.above_limit);
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

/// Metres as millimetres, to a micrometre.
pub(super) fn millimetres(metres: f64) -> f64 {
    (metres * 1e6).round() / 1e3
}

/// A number with so many digits.
fn significant_digits(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits.saturating_sub(1))
        .parse()
        .unwrap_or(value)
}
