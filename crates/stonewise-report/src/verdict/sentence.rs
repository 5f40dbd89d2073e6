//! The verdict in words.

use super::area::{gives, state_of};
use super::case::Case;
use super::judged::{Finding, Judged};
use super::limits::{Placed, in_words, of_attention};
use crate::texts::{Texts, counted, fill};
use stonewise_base::thresholds::{Level, Quantity, Thresholds};
use stonewise_core::registration::{ZONE_EXTENTS_M, ZoneKind};
use stonewise_figure::count;
use stonewise_results::records::{Area, DeformedZone, Largest, Reason, ReasonCode, State};

/// What the clauses are made from.
struct Speaker<'a> {
    case: &'a Case,
    thresholds: &'a Thresholds,
    judged: &'a Judged,
    wall: &'a Area,
    texts: &'static Texts,
}

/// The sentence on the wall: its state, why, and the most important numbers.
pub(super) fn sentence(
    case: &Case,
    thresholds: &Thresholds,
    judged: &Judged,
    wall: &Area,
    texts: &'static Texts,
) -> String {
    let speaker = Speaker {
        case,
        thresholds,
        judged,
        wall,
        texts,
    };
    let mut clauses: Vec<String> = speaker.deciding().iter().map(|r| speaker.clause(*r)).collect();
    clauses.extend(speaker.numbers());
    clauses.extend(speaker.shape());
    clauses.extend(speaker.not_measured());
    let [colon, between] = ["language.colon", "language.clause"].map(|key| texts.language.text(key));
    format!("{}{colon}{}.", texts.state(wall.state), clauses.join(between))
}

/// Every reason in words.
pub(super) fn reasons(
    case: &Case,
    thresholds: &Thresholds,
    judged: &Judged,
    wall: &Area,
    texts: &'static Texts,
) -> Vec<Reason> {
    let speaker = Speaker {
        case,
        thresholds,
        judged,
        wall,
        texts,
    };
    let reason = |code: &ReasonCode| Reason {
        code: *code,
        text: speaker.clause(*code),
    };
    wall.reasons.iter().map(reason).collect()
}

/// Share of the stones without a motion from which the sentence says how many they are.
const MANY_NOT_MEASURED: f64 = 0.2;

impl Speaker<'_> {
    /// How many stones the sentence says nothing of, where they are many and no reason says so.
    fn not_measured(&self) -> Option<String> {
        use ReasonCode as R;
        let masonry = || self.case.stones.iter().filter(|s| s.is_masonry);
        let (stones, missing) = (
            masonry().count(),
            masonry().filter(|s| s.measured.is_none()).count(),
        );
        let is_said = |r: &ReasonCode| {
            matches!(
                r,
                R::NothingMeasured | R::FewMeasured | R::InDoubt | R::NotConverged
            )
        };
        let is_worth_saying = missing as f64 >= MANY_NOT_MEASURED * stones as f64 && missing > 0;
        (is_worth_saying && !self.wall.reasons.iter().any(is_said)).then(|| {
            let text = self.texts.clauses.not_measured;
            counted(text, missing, &[("m", &count(stones))])
        })
    }

    /// The reasons that the sentence names: those that give the state; of several doubts the first.
    fn deciding(&self) -> Vec<ReasonCode> {
        let wanted = |reason: &ReasonCode| match self.wall.state {
            State::Alarm => state_of(*reason) == State::Alarm || *reason == ReasonCode::StonesLost,
            State::Attention => state_of(*reason) == State::Attention,
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
            R::Alarm(quantity) => self.beyond(quantity, Level::Alarm, reason),
            R::Attention(quantity) => self.beyond(quantity, Level::Attention, reason),
            R::NotJudged(Quantity::Departure) => c.departure_not_judged.to_owned(),
            R::NotJudged(_) => c.rate_not_judged.to_owned(),
            R::DeformationReachesThreshold => self.counted(c.deformed_reaches, reason),
            R::DeformationShown => counted(c.deformed, self.judged.deformed_zones().len(), &[]),
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
            R::BelowThresholds => self.below(),
            R::NoMotionShown => c.none_shown.to_owned(),
        }
    }

    /// What a reason names.
    fn named(&self, reason: ReasonCode) -> Vec<&Finding> {
        let all = self.judged.findings.iter();
        all.filter(|f| gives(f, reason)).collect()
    }

    fn beyond(&self, quantity: Quantity, level: Level, reason: ReasonCode) -> String {
        let c = &self.texts.clauses;
        let text = self.counted(c.beyond(quantity), reason);
        fill(&text, &[("level", c.levels[level as usize])])
    }

    /// A text with the number of what a reason names, and with its thresholds.
    fn counted(&self, text: [&'static str; 2], reason: ReasonCode) -> String {
        let named = self.named(reason);
        counted(text, named.len(), &[("t", &self.limits(&named))])
    }

    /// The thresholds that decided.
    fn limits(&self, named: &[&Finding]) -> String {
        let compared: Vec<Placed> = named.iter().map(|f| (f.threshold, f.zone)).collect();
        in_words(self.thresholds, &compared, self.texts)
    }

    /// What is known of the shape of the wall; nothing of a run in doubt.
    fn shape(&self) -> Option<String> {
        let found = self
            .judged
            .deformation
            .as_ref()
            .filter(|_| self.case.is_sound())?;
        let c = &self.texts.clauses;
        let mm = |millimetres: f64| self.texts.mm(millimetres / 1e3);
        let Some(zone) = found.zones.first() else {
            found.p?;
            let limits = found
                .detection_limit_mm
                .iter()
                .zip(found.detection_limit_in_face_mm);
            let known = limits
                .zip(ZONE_EXTENTS_M)
                .find_map(|((out, in_face), extent_m)| Some(((*out)?, in_face, extent_m)));
            return Some(known.map_or(c.shape_kept.to_owned(), |(out, in_face, extent_m)| {
                fill(
                    c.shape_kept_within,
                    &[
                        ("extent", &*self.texts.threshold(extent_m)),
                        ("out", &*mm(out)),
                        ("in_face", &*self.texts.mm_or_dash(in_face.map(|mm| mm / 1e3))),
                    ],
                )
            }));
        };

        Some(zone_in_words(zone, self.texts))
    }

    fn reaching(&self) -> String {
        let c = &self.texts.clauses;
        let reason = ReasonCode::IntervalReachesThreshold;
        let stones = self.judged.stones.iter().filter(|s| s.reaches).count();
        let named = self.named(reason);
        let joints = named.iter().filter(|f| f.quantity == Quantity::Joints).count();
        let text = match (stones, joints) {
            (_, 0) => c.reaches,
            (0, _) => c.joints_reach,
            _ => c.stones_or_joints_reach,
        };
        counted(text, stones + joints, &[("t", &self.limits(&named))])
    }

    fn below(&self) -> String {
        let c = &self.texts.clauses;
        let zones = self.judged.stones.iter().map(|s| s.zone).collect();
        let is_asked = |f: &Finding| f.quantity == Quantity::Joints;
        let text = match self.judged.findings.iter().any(is_asked) {
            true => c.below_with_joints,
            false => c.below,
        };
        let mut compared = of_attention(self.thresholds, &zones);
        if compared.is_empty() {
            // Only deformations have thresholds.
            let deformation = self.thresholds.of(Quantity::Deformation, None);
            compared.extend(deformation.take(1).map(|t| (t, None)));
        }
        let t = in_words(self.thresholds, &compared, self.texts);
        counted(text, self.wall.measured, &[("t", &t)])
    }

    /// Clauses with numbers that belong to the state.
    fn numbers(&self) -> Vec<String> {
        let c = &self.texts.clauses;
        let mut out = Vec::new();
        match self.wall.state {
            State::Alarm | State::Attention => {
                out.extend(self.largest());
                if self.wall.reasons.contains(&ReasonCode::DatumUnknown) {
                    out.push(c.datum_unknown.to_owned());
                }
            }
            State::CannotTell if self.case.not_converged || self.case.in_doubt => {
                // As if the run were sound: what the numbers alone would say.
                let apparent = self.judged.stones.iter().filter(|s| s.apparent_alarm).count();
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
        let text = self.texts.clauses.detection_limit(self.case.has_datum());
        Some(fill(text, &[("median", &*self.texts.mm(limit.median_mm / 1e3))]))
    }
}

/// What a zone of deformation did, how large it is, and against what it moved.
pub(crate) fn zone_in_words(zone: &DeformedZone, texts: &Texts) -> String {
    let c = &texts.clauses;
    let figure = |value: f64| texts.mm(value / 1e3);
    let size = match zone.diameter_m {
        Some(diameter_m) => fill(c.diameter, &[("diameter", &*figure(diameter_m))]),
        None => fill(
            c.sides,
            &[
                ("length", &*figure(zone.length_m)),
                ("width", &*figure(zone.width_m)),
            ],
        ),
    };
    let did = match zone.kind {
        ZoneKind::Bulge if zone.mean_mm[2] < 0.0 => c.pressed_in,
        kind => c.shape[kind as usize],
    };
    let [low, high] = zone.interval_mm.map(figure);
    fill(
        did,
        &[
            ("size", &*size),
            ("against", c.against[zone.against as usize]),
            ("length", &*figure(zone.largest_mm)),
            ("low", &*low),
            ("high", &*high),
        ],
    )
}
