//! The verdict in words.

use super::case::Case;
use super::judged::{Judged, Level};
use crate::figure::count;
use crate::report_params::Language;
use crate::results::records::{Area, Largest, Reason, ReasonCode, State};
use crate::texts::{Texts, counted, fill};
use crate::thresholds::{Levels, Measures, Thresholds};

/// What the clauses are made from.
struct Speaker<'a> {
    case: &'a Case,
    thresholds: &'a Thresholds,
    judged: &'a Judged,
    wall: &'a Area,
    texts: &'static Texts,
}

/// The sentence on the wall: its state, why, and the most important numbers. `apparent`: stones beyond the
/// alarm threshold if the run were sound.
pub(super) fn sentence(
    case: &Case,
    thresholds: &Thresholds,
    judged: &Judged,
    wall: &Area,
    apparent: usize,
    language: Language,
) -> String {
    let speaker = Speaker {
        case,
        thresholds,
        judged,
        wall,
        texts: language.texts(),
    };
    let mut clauses: Vec<String> = speaker.deciding().iter().map(|r| speaker.clause(*r)).collect();
    clauses.extend(speaker.numbers(apparent));
    format!("{}: {}.", speaker.texts.state(wall.state), clauses.join("; "))
}

/// Every reason in words.
pub(super) fn reasons(
    case: &Case,
    thresholds: &Thresholds,
    judged: &Judged,
    wall: &Area,
    language: Language,
) -> Vec<Reason> {
    let speaker = Speaker {
        case,
        thresholds,
        judged,
        wall,
        texts: language.texts(),
    };
    let reason = |code: &ReasonCode| Reason {
        code: *code,
        text: speaker.clause(*code),
    };
    wall.reasons.iter().map(reason).collect()
}

impl Speaker<'_> {
    /// The reasons that the sentence names: those that give the state; of several doubts the first.
    fn deciding(&self) -> Vec<ReasonCode> {
        use ReasonCode as R;
        let wanted = |r: &R| match self.wall.state {
            State::Alarm => matches!(
                r,
                R::LengthAlarm | R::NeighboursAlarm | R::JointsAlarm | R::StonesLost
            ),
            State::Attention => matches!(
                r,
                R::LengthAttention
                    | R::NeighboursAttention
                    | R::JointsAttention
                    | R::StonesLost
                    | R::MotionShown
            ),
            State::CannotTell | State::Fine => true,
        };
        let most = if matches!(self.wall.state, State::CannotTell | State::Fine) {
            1
        } else {
            4
        };
        self.wall
            .reasons
            .iter()
            .copied()
            .filter(wanted)
            .take(most)
            .collect()
    }

    fn clause(&self, reason: ReasonCode) -> String {
        use ReasonCode as R;
        let c = &self.texts.clauses;
        let wall = self.wall;
        match reason {
            R::NotConverged => c.not_converged.to_owned(),
            R::InDoubt => c.in_doubt.to_owned(),
            R::LengthAlarm => self.length(c.moved_alarm, Level::Alarm),
            R::LengthAttention => self.length(c.moved_attention, Level::Attention),
            R::NeighboursAlarm => self.neighbours(c.neighbours_alarm, Level::Alarm),
            R::NeighboursAttention => self.neighbours(c.neighbours_attention, Level::Attention),
            R::JointsAlarm => self.joints(c.joints_alarm, Level::Alarm),
            R::JointsAttention => self.joints(c.joints_attention, Level::Attention),
            R::StonesLost => counted(c.lost, wall.lost, &[]),
            R::MotionShown if wall.moved > 0 => {
                let text = if self.case.has_datum() {
                    c.moved
                } else {
                    c.moved_common
                };
                counted(text, wall.moved, &[("m", &count(wall.measured))])
            }
            R::MotionShown => counted(c.loose, wall.loose, &[]),
            R::NothingMeasured => c.nothing_measured.to_owned(),
            R::FewMeasured => counted(c.few_measured, wall.measured, &[("m", &count(wall.stones))]),
            R::DatumUnknown => c.datum_unknown.to_owned(),
            R::IntervalReachesThreshold => self.reaching(),
            R::BelowThresholds => {
                let t = self.limits(|m| [m.length, m.neighbours, m.joints], Levels::attention_m, None);
                counted(c.below, wall.measured, &[("t", &t)])
            }
            R::NoMotionShown => c.none_shown.to_owned(),
        }
    }

    fn length(&self, text: [&'static str; 2], level: Level) -> String {
        let beyond = self.judged.stones.iter().filter(|s| s.length == level);
        let zones: Vec<Option<usize>> = beyond.map(|s| s.zone).collect();
        self.beyond(text, level, &zones, |m| m.length)
    }

    fn neighbours(&self, text: [&'static str; 2], level: Level) -> String {
        let beyond = self.judged.stones.iter().filter(|s| s.neighbours == level);
        let zones: Vec<Option<usize>> = beyond.map(|s| s.zone).collect();
        self.beyond(text, level, &zones, |m| m.neighbours)
    }

    fn joints(&self, text: [&'static str; 2], level: Level) -> String {
        let beyond = self.judged.joints.iter().filter(|j| j.opening == level);
        let zones: Vec<Option<usize>> = beyond.map(|j| j.zone).collect();
        self.beyond(text, level, &zones, |m| m.joints)
    }

    fn beyond(
        &self,
        text: [&'static str; 2],
        level: Level,
        zones: &[Option<usize>],
        of: fn(&Measures) -> Levels,
    ) -> String {
        let threshold = match level {
            Level::Alarm => Levels::alarm_m,
            _ => Levels::attention_m,
        };
        let pick = |m: &Measures| [of(m), Levels::default(), Levels::default()];
        let t = self.limits(pick, threshold, Some(zones));
        counted(text, zones.len(), &[("t", &t)])
    }

    fn reaching(&self) -> String {
        let reaches = |level: Level| level == Level::Reaches;
        let stones = self
            .judged
            .stones
            .iter()
            .filter(|s| reaches(s.length) || reaches(s.neighbours));
        let joints = self.judged.joints.iter().filter(|j| reaches(j.opening));
        let zones: Vec<Option<usize>> = stones.map(|s| s.zone).chain(joints.map(|j| j.zone)).collect();
        let t = self.limits(
            |m| [m.length, m.neighbours, m.joints],
            Levels::attention_m,
            Some(&zones),
        );
        counted(self.texts.clauses.reaches, zones.len(), &[("t", &t)])
    }

    /// The thresholds of these zones as "3 or 5", ascending; of all zones where none are named.
    fn limits(
        &self,
        of: impl Fn(&Measures) -> [Levels; 3],
        threshold: fn(&Levels) -> Option<f64>,
        zones: Option<&[Option<usize>]>,
    ) -> String {
        let everywhere: Vec<Option<usize>> = self.judged.stones.iter().map(|s| s.zone).collect();
        let zones = zones.unwrap_or(&everywhere);
        let levels = zones.iter().flat_map(|zone| of(&self.thresholds.measures(*zone)));
        let mut all: Vec<f64> = levels.filter_map(|l| threshold(&l)).map(|m| m * 1e3).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        let words: Vec<String> = all.iter().map(|mm| self.texts.threshold(*mm)).collect();
        words.join(&format!(" {} ", self.texts.clauses.or))
    }

    /// Clauses with numbers that belong to the state.
    fn numbers(&self, apparent: usize) -> Vec<String> {
        let c = &self.texts.clauses;
        let mut out = Vec::new();
        match self.wall.state {
            State::Alarm | State::Attention => out.extend(self.largest()),
            State::CannotTell if self.case.not_converged || self.case.in_doubt => {
                if apparent > 0 {
                    out.push(counted(c.apparent, apparent, &[]));
                }
            }
            State::CannotTell => {
                let only_datum = self.wall.reasons == [ReasonCode::DatumUnknown];
                match self.largest() {
                    Some(largest) => out.push(largest),
                    None if only_datum => out.push(c.none_against_common.to_owned()),
                    None => {}
                }
                out.extend(self.limit());
            }
            State::Fine => out.extend(self.limit()),
        }
        out
    }

    fn largest(&self) -> Option<String> {
        let Largest {
            stone_id,
            length_mm,
            interval_mm: [low, high],
        } = self.wall.largest?;
        let c = &self.texts.clauses;
        let says_what_moved = self.deciding().contains(&ReasonCode::MotionShown) && self.wall.moved > 0;
        let text = match self.case.has_datum() {
            true => c.largest,
            false if says_what_moved => c.largest_of_these,
            false => c.largest_common,
        };
        let mm = |millimetres: f64| self.texts.mm(millimetres / 1e3);
        Some(fill(
            text,
            &[
                ("length", &mm(length_mm)),
                ("low", &mm(low)),
                ("high", &mm(high)),
                ("id", &stone_id.to_string()),
            ],
        ))
    }

    fn limit(&self) -> Option<String> {
        let limit = self.wall.detection_limit?;
        let mm = |millimetres: f64| self.texts.mm(millimetres / 1e3);
        let values = [
            ("median", &*mm(limit.median_mm)),
            ("high", &*mm(limit.percentile_90_mm)),
        ];
        Some(fill(self.texts.clauses.limit, &values))
    }
}
