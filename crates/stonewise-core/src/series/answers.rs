//! The four answers that a series gives.

use super::basis::Term;
use super::stone_model::Coefficient;
use crate::id::StoneId;
use crate::statistics::{median, q_values};
use serde::{Deserialize, Serialize};

/// Share of false ones that is accepted among the stones that are named; of a wall on which nothing happened, the
/// probability that one is named.
pub(super) const LEVEL: f64 = 0.05;
/// Share of false ones among trends, and among steps, that is accepted: half of [`LEVEL`], so that one of the two is
/// claimed of a still wall with the probability [`LEVEL`].
pub(super) const CLAIM_LEVEL: f64 = LEVEL / 2.0;
/// Half the width of a normal 95 % interval in standard deviations.
const Z: f64 = 1.96;

/// An answer in a word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Word {
    /// It is so.
    #[serde(rename = "yes")]
    Yes,
    /// It is not so.
    #[serde(rename = "no")]
    No,
    /// The epochs do not say.
    #[default]
    #[serde(rename = "cannot tell")]
    CannotTell,
}

/// Why there is no answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum Unanswered {
    /// It takes more epochs with a date.
    FewEpochs {
        /// Epochs that there are.
        have: usize,
        /// Epochs that it takes.
        need: usize,
    },
    /// No stone was measured in epochs enough.
    NothingMeasured,
    /// A trend is shown, but this term went with time over the epochs and may be its cause.
    GoesWith {
        /// The term.
        term: Term,
    },
}

/// What a stone does, for the test of all stones: a departure, a velocity or a step.
pub(super) struct Shown {
    pub stone: StoneId,
    pub does: Coefficient,
    /// Of a step: the first epoch after it.
    pub epoch: Option<String>,
    /// Where it takes part in what a zone does: the false discovery rate at which the zone is named.
    pub with_zone: Option<f64>,
}

/// What one stone does: a departure, a velocity or a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Departure {
    /// The stone.
    pub stone_id: u32,
    /// Length, millimetres (of a velocity in a year).
    pub length_mm: f64,
    /// Its 95 % interval.
    pub interval_mm: [f64; 2],
    /// Of a step: the first epoch after it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epoch: Option<String>,
}

/// A condition of the newest epoch that lies beyond those of the others, on which its prediction rests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Extrapolation {
    /// The term.
    pub term: Term,
    /// What the newest epoch has: metres, degrees, or the part of the year that has passed.
    pub value: f64,
    /// The smallest and the largest of the others; of the season the part of the year of the nearest, twice.
    pub range: [f64; 2],
}

/// An answer with its numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The answer.
    pub answer: Word,
    /// Why there is none.
    #[serde(default)]
    pub reason: Option<Unanswered>,
    /// Stones that were tested.
    pub tested: usize,
    /// Stones that are named, with the false discovery rate controlled at 5 %, of trends and steps at 2.5 %: by
    /// themselves, or as part of a zone that is.
    pub stones: Vec<u32>,
    /// Smallest q value of a stone, or of a zone to which it belongs.
    pub smallest_q: Option<f64>,
    /// The stone that does most among those named.
    pub largest: Option<Departure>,
    /// Half the width of a stone's 95 % interval, millimetres (of a velocity in a year): median over the stones, of
    /// each its least certain direction.
    pub half_width_mm: Option<f64>,
    /// Conditions of the newest epoch that lie beyond those of the others, where the answer rests on them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub extrapolated: Vec<Extrapolation>,
}

/// The four answers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SeriesAnswers {
    /// Whether the newest epoch is as the model with all its terms predicts it from the others.
    pub as_predicted: Answer,
    /// Whether the newest epoch continues the mean course of the earlier ones, whatever the conditions.
    pub as_in_the_past: Answer,
    /// Whether stones move in proportion to time.
    pub trend: Answer,
    /// Whether stones moved abruptly between two epochs.
    pub anomaly: Answer,
}

impl Answer {
    /// No answer.
    pub(super) fn none(reason: Unanswered) -> Self {
        Self {
            reason: Some(reason),
            ..Self::default()
        }
    }

    /// From what each stone does. `if_named`: the answer where stones are named; otherwise the opposite.
    pub(super) fn of(found: &[Shown], if_named: Word, level: f64) -> Self {
        if found.is_empty() {
            return Self::none(Unanswered::NothingMeasured);
        }
        let p: Vec<f64> = found.iter().map(|f| f.does.p).collect();
        let mut q = q_values(&p);
        q.iter_mut()
            .zip(found)
            .for_each(|(q, f)| *q = q.min(f.with_zone.unwrap_or(1.0)));
        let named: Vec<usize> = (0..found.len()).filter(|&i| q[i] <= level).collect();
        let length = |i: &usize| found[*i].does.value.norm();
        let largest = named
            .iter()
            .copied()
            .max_by(|a, b| length(a).total_cmp(&length(b)));

        let mut widths: Vec<f64> = found.iter().map(|f| 1e3 * Z * f.does.sd.max()).collect();
        let opposite = match if_named {
            Word::Yes => Word::No,
            Word::No => Word::Yes,
            Word::CannotTell => Word::CannotTell,
        };

        Self {
            answer: if named.is_empty() { opposite } else { if_named },
            reason: None,
            tested: found.len(),
            stones: named.iter().map(|&i| found[i].stone.0).collect(),
            smallest_q: q.iter().copied().reduce(f64::min),
            largest: largest.map(|i| departure(&found[i])),
            half_width_mm: median(&mut widths),
            extrapolated: Vec::new(),
        }
    }
}

fn departure(shown: &Shown) -> Departure {
    let does = &shown.does;
    let length = does.value.norm();
    let direction = does.value / length.max(f64::MIN_POSITIVE);
    let half = Z * direction.component_mul(&does.sd).norm();
    Departure {
        stone_id: shown.stone.0,
        length_mm: 1e3 * length,
        interval_mm: [1e3 * (length - half).max(0.0), 1e3 * (length + half)],
        epoch: shown.epoch.clone(),
    }
}
