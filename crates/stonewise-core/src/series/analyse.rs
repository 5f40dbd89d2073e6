//! From the looks of all epochs to the model of every stone and the four answers.

use super::answers::{Answer, CLAIM_LEVEL, Extrapolation, LEVEL, SeriesAnswers, Shown, Unanswered, Word};
use super::basis::{Basis, SeriesEpoch, Term};
use super::fit::Fit;
use super::look::StoneSeries;
use super::moderated::VarianceFactor;
use super::steps::{Fitted, Settled, SteppedZone, factors_of, settle};
use super::stone_model::{
    AxisModel, Coefficient, Seen, Step, Wave, coefficient, likeliest_step, of_term, scale_of, wave, with_step,
};
use super::terms::{Inseparable, Model, WhyInseparable, models};
use crate::id::StoneId;
use crate::statistics::q_values;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

/// Epochs without which no answer is given.
const LEAST_EPOCHS: usize = 4;
/// Epochs of a straight line with something left over.
const LEAST_OF_A_LINE: usize = 3;
/// Factor on variances beyond which a stone loses weight in the choice of terms.
const OUTLYING_FACTOR: f64 = 9.0;
/// Part of a year within which epochs lie in one season: two months.
const SEASON_APART: f64 = 1.0 / 6.0;

/// A coefficient of a stone's model: along the wall, up and out, with standard deviations of which 1.96 hold 95 %.
pub type Trend = Coefficient;

/// What was found of a series.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SeriesFindings {
    /// Columns of the model, the trend first of its terms; `None` where there is no model.
    pub basis: Option<Basis>,
    /// Terms that the epochs cannot carry.
    pub inseparable: Vec<Inseparable>,
    /// Epochs without a date, which take no part.
    pub undated: Vec<String>,
    /// How much larger errors are than claimed: along the wall, up and out.
    pub factors: Option<[VarianceFactor; 3]>,
    /// Stones that were measured in epochs enough, in the order given.
    pub stones: Vec<StoneTrend>,
    /// How far the newest epoch lies from what the model says that is fitted to the others, by stone.
    pub departures: Vec<(StoneId, Trend)>,
    /// The four answers.
    pub answers: SeriesAnswers,
}

impl SeriesFindings {
    /// Terms of the model, the trend first; none where there is no model.
    pub fn terms(&self) -> &[Term] {
        self.basis.as_ref().map_or(&[], |b| &b.terms)
    }
}

/// The model of a stone.
#[derive(Clone, Debug, PartialEq)]
pub struct StoneTrend {
    /// Stone of the reference.
    pub stone: StoneId,
    /// Epochs in which it was measured, the reference among them.
    pub epochs: usize,
    /// Metres a year.
    pub velocity: Trend,
    /// The smallest false discovery rate at which it counts as moving in proportion to time.
    pub velocity_q: f64,
    /// Metres for each metre of level.
    pub level: Option<Trend>,
    /// Metres for each degree.
    pub temperature: Option<Trend>,
    /// Metres: cosine and sine of the year.
    pub season: Option<[Trend; 2]>,
    /// Its amplitude, and when it is largest.
    pub wave: Option<Wave>,
    /// An abrupt motion, where one is shown.
    pub step: Option<Step>,
    /// All of it: along the wall, up and out.
    pub model: [AxisModel; 3],
    /// Factors on the standard deviations of single looks.
    pub scale: Vector3<f64>,
}

/// Fits the model in time. `epochs`: all of them; `stones`: with a look for each.
///
/// Epochs without a date take no part. Terms beside the trend enter by Akaike's criterion with the correction for few
/// observations (Hurvich & Tsai 1989), over all stones that all epochs show. Cost: linear in the stones.
///
/// `zones`: what pairs of epochs name as zones of deformation. What the mean of a zone shows, its stones need not show
/// each by itself.
pub fn analyse(
    epochs: &[SeriesEpoch],
    stones: &[StoneSeries],
    zones: &[BTreeSet<StoneId>],
) -> SeriesFindings {
    let mut dated: Vec<usize> = (0..epochs.len()).filter(|&e| epochs[e].years.is_some()).collect();
    dated.sort_by(|a, b| {
        epochs[*a]
            .years
            .partial_cmp(&epochs[*b].years)
            .unwrap_or(Ordering::Equal)
    });
    let undated = epochs.iter().filter(|e| e.years.is_none());
    let mut found = SeriesFindings {
        undated: undated.map(|e| e.name.clone()).collect(),
        ..SeriesFindings::default()
    };
    let epochs: Vec<&SeriesEpoch> = dated.iter().map(|&e| &epochs[e]).collect();
    let few = Unanswered::FewEpochs {
        have: epochs.len(),
        need: LEAST_EPOCHS,
    };

    found.answers = unanswered(&few);
    if epochs.len() < LEAST_OF_A_LINE {
        return found;
    }
    let (models, inseparable) = models(&epochs);
    found.inseparable = inseparable;
    let only_dated = |s: &StoneSeries| StoneSeries {
        stone: s.stone,
        looks: dated.iter().map(|&e| s.looks[e]).collect(),
        smoothed: s.smoothed,
    };
    let stones: Vec<StoneSeries> = stones.iter().map(only_dated).collect();
    let Some(model) = choose(&models, &stones) else {
        return found;
    };

    let settled = settle(model, &stones, zones);
    found.basis = Some(model.basis.clone());
    found.factors = Some(settled.factors);
    found.stones = described(&settled, model, &dated, &stones);
    if epochs.len() < LEAST_EPOCHS {
        return found;
    }
    let plain = &models[0];
    let departing = departures(&settled, model);
    found.departures = departing.iter().map(|d| (d.stone, d.does)).collect();
    found.answers = SeriesAnswers {
        as_predicted: Answer {
            extrapolated: extrapolated(&epochs, model),
            ..Answer::of(&departing, Word::No, LEVEL)
        },
        as_in_the_past: Answer::of(&departures(&settled, plain), Word::No, LEVEL),
        trend: trend(&found),
        anomaly: anomaly(&settled, model, &epochs),
    };

    found
}

fn unanswered(reason: &Unanswered) -> SeriesAnswers {
    let none = || Answer::none(reason.clone());
    SeriesAnswers {
        as_predicted: none(),
        as_in_the_past: none(),
        trend: none(),
        anomaly: none(),
    }
}

/// The model of the smallest criterion; the plain one where no stone was seen in all epochs.
fn choose<'a>(models: &'a [Model], stones: &[StoneSeries]) -> Option<&'a Model> {
    let plain = models.first()?;
    let largest = models.iter().max_by_key(|m| m.unknowns())?;
    let complete: Vec<Seen> = stones
        .iter()
        .filter(|s| s.looks.iter().all(Option::is_some))
        .map(Seen::of)
        .collect();
    let epochs = plain.design.nrows() as f64;

    // Stones that no model fits count less, the same in all models.
    let weight = |seen: &Seen| {
        let fits = seen.fit(&largest.design)?;
        Some(fits.map(|f| {
            let factor = f.residuals / (f.freedom.max(1)) as f64;
            (OUTLYING_FACTOR / factor).min(1.0)
        }))
    };

    let weights: Vec<Option<[f64; 3]>> = complete.par_iter().map(weight).collect();
    if complete.is_empty() {
        return Some(plain);
    }

    let criterion = |model: &Model| {
        let residuals = |(seen, weights): (&Seen, &Option<[f64; 3]>)| {
            let (fits, weights) = (seen.fit(&model.design)?, weights.as_ref()?);
            Some(
                fits.iter()
                    .zip(weights)
                    .map(|(f, w)| w * f.residuals)
                    .sum::<f64>(),
            )
        };
        let sum: f64 = complete.iter().zip(&weights).filter_map(residuals).sum();
        let share = model.unknowns() as f64 / epochs;
        let mean = sum / (3.0 * complete.len() as f64 * epochs);
        mean.max(f64::MIN_POSITIVE).ln() + 2.0 * share / (1.0 - share)
    };

    let by_criterion = models.iter().map(|m| (m, criterion(m)));
    by_criterion.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(m, _)| m)
}

/// `places`: of the epochs that take part among all; `stones`: all that were given.
fn described(settled: &Settled, model: &Model, places: &[usize], stones: &[StoneSeries]) -> Vec<StoneTrend> {
    let factors = &settled.factors;
    let smoothed: BTreeMap<StoneId, Vector3<f64>> = stones.iter().map(|s| (s.stone, s.smoothed)).collect();
    let describe = |f: &Fitted| {
        let term = |term: Term| of_term(&f.fits, factors, model, term);
        let season = model.place(Term::Season);
        let of_axis = |axis: usize| AxisModel::of(&f.fits[axis], &factors[axis]);
        let mut axes = [of_axis(0), of_axis(1), of_axis(2)];
        let mut velocity = match f.instead {
            Some(left) => Coefficient { p: 1.0, ..left },
            None => term(Term::Trend)?,
        };
        let smoothed = smoothed.get(&f.stone).copied().unwrap_or_default();
        for axis in 0..3 {
            velocity.sd[axis] = velocity.sd[axis].hypot(smoothed[axis]);
            if let Some(trend) = model.place(Term::Trend) {
                axes[axis].covariance[(trend, trend)] += smoothed[axis].powi(2);
            }
        }
        Some(StoneTrend {
            stone: f.stone,
            epochs: f.seen.epochs.len(),
            velocity,
            velocity_q: 1.0,
            level: term(Term::Level),
            temperature: term(Term::Temperature),
            season: season.map(|c| [c, c + 1].map(|c| coefficient(&f.fits, factors, c))),
            wave: season.map(|c| wave(&axes, c)),
            scale: Vector3::from_fn(|axis, _| scale_of(&f.fits[axis], &factors[axis])),
            model: axes,
            step: f.step.map(|step| Step {
                epoch: places[step.epoch],
                ..step
            }),
        })
    };

    let mut all: Vec<StoneTrend> = settled.stones.iter().filter_map(describe).collect();
    let p: Vec<f64> = all.iter().map(|s| s.velocity.p).collect();
    all.iter_mut()
        .zip(q_values(&p))
        .for_each(|(s, q)| s.velocity_q = q);
    all
}

/// How far the newest epoch is from where the others say by a model: its look gets an unknown of its own.
fn departures(settled: &Settled, model: &Model) -> Vec<Shown> {
    let newest = model.design.nrows() - 1;
    let depart = |f: &Fitted| {
        if f.seen.epochs.last() != Some(&newest) {
            return None;
        }
        let design = with_step(&f.design(model, Some(newest)), newest);
        f.seen.fit(&design).filter(|f| f[0].freedom > 0)
    };
    let fits: Vec<Option<[Fit; 3]>> = settled.stones.par_iter().map(depart).collect();
    let factors = factors_of(fits.iter().flatten(), VarianceFactor::of);
    let of_stone = |place: usize| {
        let fits = fits[place].as_ref()?;
        Some(coefficient(fits, &factors, fits[0].coefficients.len() - 1))
    };

    let typical = factors_of(fits.iter().flatten(), VarianceFactor::typical);
    let of_zone = |z: &SteppedZone| {
        z.zone
            .last(&with_step(&z.design(model, newest), newest), &typical)
    };
    let of_zones: Vec<Option<Coefficient>> = settled.zones.iter().map(of_zone).collect();
    let p: Vec<f64> = of_zones.iter().map(|z| z.map_or(1.0, |z| z.p)).collect();
    let mut with_zone: BTreeMap<usize, f64> = BTreeMap::new();
    for ((zone, does), q) in settled.zones.iter().zip(&of_zones).zip(q_values(&p)) {
        let Some(does) = does.filter(|_| q <= LEVEL) else {
            continue;
        };
        for (place, _) in zone.zone.taking_part(&does, of_stone) {
            let smallest = with_zone.entry(place).or_insert(q);
            *smallest = smallest.min(q);
        }
    }

    let shown = |(place, stone): (usize, &Fitted)| {
        Some(Shown {
            stone: stone.stone,
            does: of_stone(place)?,
            epoch: None,
            with_zone: with_zone.get(&place).copied(),
        })
    };
    settled.stones.iter().enumerate().filter_map(shown).collect()
}

/// The conditions of the model in which the newest epoch lies beyond the others.
fn extrapolated(epochs: &[&SeriesEpoch], model: &Model) -> Vec<Extrapolation> {
    let Some((newest, others)) = epochs.split_last() else {
        return Vec::new();
    };
    let of_term = |&term: &Term| match term {
        Term::Trend => None,
        Term::Season => {
            let apart = |e: &SeriesEpoch| {
                let apart = (e.of_year - newest.of_year).rem_euclid(1.0);
                apart.min(1.0 - apart)
            };
            let nearest = others.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
            (apart(nearest) > SEASON_APART).then_some(Extrapolation {
                term,
                value: newest.of_year,
                range: [nearest.of_year; 2],
            })
        }
        Term::Level | Term::Temperature => {
            let value = term.value(newest)?;
            let values = others.iter().filter_map(|e| term.value(e));
            let range = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
                [low.min(v), high.max(v)]
            });
            (value < range[0] || value > range[1]).then_some(Extrapolation { term, value, range })
        }
    };
    model.basis.terms.iter().filter_map(of_term).collect()
}

fn trend(found: &SeriesFindings) -> Answer {
    let of_stone = |s: &StoneTrend| Shown {
        stone: s.stone,
        does: s.velocity,
        epoch: None,
        with_zone: None,
    };
    let velocities: Vec<Shown> = found.stones.iter().map(of_stone).collect();
    let mut answer = Answer::of(&velocities, Word::Yes, CLAIM_LEVEL);
    let cause = found
        .inseparable
        .iter()
        .find(|i| i.why == WhyInseparable::GoesWith { other: Term::Trend });
    if let (Some(cause), Word::Yes) = (cause, answer.answer) {
        answer.answer = Word::CannotTell;
        answer.reason = Some(Unanswered::GoesWith { term: cause.term });
    }
    answer
}

fn anomaly(settled: &Settled, model: &Model, epochs: &[&SeriesEpoch]) -> Answer {
    let step = |f: &Fitted| {
        let (step, p) = match f.step.zip(f.instead) {
            // As probable by chance as the trend in whose place it stands.
            Some((step, instead)) => (step, instead.p),
            None => {
                let (likeliest, p) = likeliest_step(&f.seen, model, &settled.factors)?;
                (f.step.filter(|_| f.with_zone.is_some()).unwrap_or(likeliest), p)
            }
        };
        let does = Coefficient {
            value: step.value,
            sd: step.sd,
            p,
        };
        Some(Shown {
            stone: f.stone,
            does,
            epoch: Some(epochs[step.epoch].name.clone()),
            with_zone: f.with_zone,
        })
    };
    let found: Vec<Shown> = settled.stones.par_iter().filter_map(step).collect();
    Answer::of(&found, Word::Yes, CLAIM_LEVEL)
}
