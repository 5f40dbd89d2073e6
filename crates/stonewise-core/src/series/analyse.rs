//! From the looks of all epochs to the model of every stone and the four answers.

use super::answers::{Answer, CLAIM_LEVEL, Extrapolation, LEVEL, SeriesAnswers, Unanswered, Word};
use super::basis::{Basis, SeriesEpoch, Term};
use super::fit::Fit;
use super::look::StoneSeries;
use super::moderated::VarianceFactor;
use super::stone_model::{
    AxisModel, Coefficient, Seen, Step, Wave, coefficient, likeliest_step, of_term, scale_of, wave,
    with_step, without_trend,
};
use super::terms::{Inseparable, Model, WhyInseparable, models};
use crate::id::StoneId;
use crate::statistics::q_values;
use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;
use std::cmp::Ordering;

/// Epochs without which no answer is given.
const LEAST_EPOCHS: usize = 4;
/// Epochs of a straight line with something left over.
const LEAST_OF_A_LINE: usize = 3;
/// Rounds of steps and variance factors, each of which the other changes.
const ROUNDS: usize = 5;
/// Rounds in which steps and trends of all stones, and how many there are of each, follow each other.
const MIXTURE_ROUNDS: usize = 5;
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

/// A stone while the model is fitted.
struct Fitted {
    stone: StoneId,
    seen: Seen,
    fits: [Fit; 3],
    /// Which is in the fits.
    step: Option<Step>,
    /// Where the step takes the place of a trend: what would be left of the trend beside it.
    instead: Option<Coefficient>,
}

impl Fitted {
    /// The design of its model, of the terms of `model` and its step but for one at `but`.
    fn design(&self, model: &Model, but: Option<usize>) -> DMatrix<f64> {
        let base = match self.instead {
            Some(_) => without_trend(&model.design),
            None => model.design.clone(),
        };
        match self.step.filter(|s| Some(s.epoch) != but) {
            Some(step) => with_step(&base, step.epoch),
            None => base,
        }
    }
}

/// Fits the model in time. `epochs`: all of them; `stones`: with a look for each.
///
/// Epochs without a date take no part. Terms beside the trend enter by Akaike's criterion with the correction for few
/// observations (Hurvich & Tsai 1989), over all stones that all epochs show. Cost: linear in the stones.
pub fn analyse(epochs: &[SeriesEpoch], stones: &[StoneSeries]) -> SeriesFindings {
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
    };
    let stones: Vec<StoneSeries> = stones.iter().map(only_dated).collect();
    let Some(model) = choose(&models, &stones) else {
        return found;
    };
    let (fitted, factors) = settle(model, &stones);
    found.basis = Some(model.basis.clone());
    found.factors = Some(factors);
    found.stones = described(&fitted, model, &factors, &dated);
    if epochs.len() < LEAST_EPOCHS {
        return found;
    }
    let plain = &models[0];
    found.departures = departures(&fitted, model);
    found.answers = SeriesAnswers {
        as_predicted: Answer {
            extrapolated: extrapolated(&epochs, model),
            ..continued(&found.departures)
        },
        as_in_the_past: continued(&departures(&fitted, plain)),
        trend: trend(&found),
        anomaly: anomaly(&fitted, model, &factors, &epochs),
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

/// Fits, steps and variance factors that agree with each other.
fn settle(model: &Model, stones: &[StoneSeries]) -> (Vec<Fitted>, [VarianceFactor; 3]) {
    let start = |stone: &StoneSeries| {
        let seen = Seen::of(stone);
        let fits = seen.fit(&model.design).filter(|f| f[0].freedom > 0)?;
        Some(Fitted {
            stone: stone.stone,
            seen,
            fits,
            step: None,
            instead: None,
        })
    };
    let mut fitted: Vec<Fitted> = stones.par_iter().filter_map(start).collect();
    // Steps that are not in the models yet must not count as errors that single stones have.
    let mut factors = factors_of(fitted.iter().map(|f| &f.fits), VarianceFactor::typical);
    for _ in 0..ROUNDS {
        let likeliest = |f: &Fitted| likeliest_step(&f.seen, model, &factors);
        let steps: Vec<Option<(Step, f64)>> = fitted.par_iter().map(likeliest).collect();
        let p: Vec<f64> = steps.iter().map(|s| s.as_ref().map_or(1.0, |s| s.1)).collect();
        let shown = q_values(&p);
        for ((stone, step), q) in fitted.iter_mut().zip(&steps).zip(shown) {
            stone.step = step.filter(|_| q <= CLAIM_LEVEL).map(|s| s.0);
            if let Some(fits) = stone.seen.fit(&stone.design(model, None)) {
                stone.fits = fits;
            }
        }
        factors = factors_of(fitted.iter().map(|f| &f.fits), VarianceFactor::of);
    }
    steps_for_trends(&mut fitted, model, &factors);
    (fitted, factors)
}

/// What a stone with a trend shows of a step instead of it: twice the log likelihoods of the trend and of a step before
/// each epoch, less a constant.
struct Rival {
    stone: usize,
    trend: f64,
    steps: Vec<Option<f64>>,
}

/// Gives stones whose trend is shown a step instead, where that is more probable.
///
/// Both have one coefficient a component, so that their likelihoods compare. How probable a trend and a step before each
/// epoch are beforehand is estimated over all these stones (expectation maximisation), so that stones that stepped
/// together support each other.
fn steps_for_trends(fitted: &mut [Fitted], model: &Model, factors: &[VarianceFactor; 3]) {
    let Some(column) = model.place(Term::Trend) else {
        return;
    };
    let trends: Vec<Coefficient> = fitted
        .iter()
        .map(|f| coefficient(&f.fits, factors, column))
        .collect();
    let q = q_values(&trends.iter().map(|t| t.p).collect::<Vec<f64>>());
    let epochs = model.design.nrows();
    let fit = |fits: &[Fit; 3]| -> f64 {
        let squares = fits
            .iter()
            .zip(factors)
            .map(|(fit, factor)| fit.residuals / factor.factor);
        -squares.sum::<f64>()
    };
    let plain = without_trend(&model.design);
    let rival = |stone: usize| {
        let of = &fitted[stone];
        let step = |epoch: usize| {
            let is_seen = of.seen.epochs.first().is_some_and(|first| *first < epoch);
            let fits = of.seen.fit(&with_step(&plain, epoch)).filter(|_| is_seen)?;
            Some(fit(&fits))
        };
        (of.step.is_none() && q[stone] <= CLAIM_LEVEL).then(|| Rival {
            stone,
            trend: fit(&of.fits),
            steps: (1..epochs).map(step).collect(),
        })
    };
    let rivals: Vec<Rival> = (0..fitted.len()).into_par_iter().filter_map(rival).collect();
    // The trend first, then a step before each epoch.
    let mut shares = vec![0.5 / (epochs - 1) as f64; epochs];
    shares[0] = 0.5;
    let mut likeliest = Vec::new();
    for _ in 0..MIXTURE_ROUNDS {
        let mut sums = vec![1.0 / epochs as f64; epochs];
        likeliest.clear();
        for rival in &rivals {
            let of_class = |c: usize| match c {
                0 => Some(rival.trend),
                _ => rival.steps[c - 1],
            };
            let logs =
                (0..epochs).map(|c| of_class(c).map_or(f64::NEG_INFINITY, |l| 0.5 * l + shares[c].ln()));
            let logs: Vec<f64> = logs.collect();
            let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let odds: Vec<f64> = logs.iter().map(|l| (l - largest).exp()).collect();
            let total: f64 = odds.iter().sum();
            sums.iter_mut()
                .zip(&odds)
                .for_each(|(sum, odds)| *sum += odds / total);
            likeliest.push(logs.iter().position(|l| *l == largest).unwrap_or(0));
        }
        let total: f64 = sums.iter().sum();
        shares = sums.into_iter().map(|sum| sum / total).collect();
    }
    for (rival, epoch) in rivals.iter().zip(likeliest).filter(|(_, class)| *class > 0) {
        let stone = &mut fitted[rival.stone];
        let both = stone.seen.fit(&with_step(&model.design, epoch));
        let Some(fits) = stone.seen.fit(&with_step(&plain, epoch)) else {
            continue;
        };
        let fits = fits.map(|fit| fit.with_zero(column));
        let found = coefficient(&fits, factors, model.unknowns());
        stone.step = Some(Step {
            epoch,
            value: found.value,
            sd: found.sd,
        });
        // Where trend and step cannot both be told, the trend alone says how well it is known.
        let left = both.map_or(trends[rival.stone], |fits| coefficient(&fits, factors, column));
        stone.instead = Some(Coefficient {
            value: Vector3::zeros(),
            sd: left.sd,
            p: trends[rival.stone].p,
        });
        stone.fits = fits;
    }
}

/// The variance factors of three components, from the residuals of all stones.
fn factors_of<'a>(
    fits: impl Iterator<Item = &'a [Fit; 3]> + Clone,
    of: fn(&[(f64, usize)]) -> VarianceFactor,
) -> [VarianceFactor; 3] {
    [0, 1, 2].map(|axis| {
        let all: Vec<(f64, usize)> = fits
            .clone()
            .map(|f| (f[axis].residuals, f[axis].freedom))
            .collect();
        of(&all)
    })
}

/// `places`: of the epochs that take part among all.
fn described(
    fitted: &[Fitted],
    model: &Model,
    factors: &[VarianceFactor; 3],
    places: &[usize],
) -> Vec<StoneTrend> {
    let describe = |f: &Fitted| {
        let term = |term: Term| of_term(&f.fits, factors, model, term);
        let season = model.place(Term::Season);
        let of_axis = |axis: usize| AxisModel::of(&f.fits[axis], &factors[axis]);
        let axes = [of_axis(0), of_axis(1), of_axis(2)];
        Some(StoneTrend {
            stone: f.stone,
            epochs: f.seen.epochs.len(),
            velocity: match f.instead {
                Some(left) => Coefficient { p: 1.0, ..left },
                None => term(Term::Trend)?,
            },
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
    let mut all: Vec<StoneTrend> = fitted.iter().filter_map(describe).collect();
    let p: Vec<f64> = all.iter().map(|s| s.velocity.p).collect();
    all.iter_mut()
        .zip(q_values(&p))
        .for_each(|(s, q)| s.velocity_q = q);
    all
}

/// How far the newest epoch is from where the others say by a model: its look gets an unknown of its own.
fn departures(fitted: &[Fitted], model: &Model) -> Vec<(StoneId, Trend)> {
    let newest = model.design.nrows() - 1;
    let depart = |f: &Fitted| {
        if f.seen.epochs.last() != Some(&newest) {
            return None;
        }
        let base = f.design(model, Some(newest));
        let column = base.ncols();
        let fits = f
            .seen
            .fit(&with_step(&base, newest))
            .filter(|f| f[0].freedom > 0)?;
        Some((f.stone, fits, column))
    };
    let found: Vec<(StoneId, [Fit; 3], usize)> = fitted.par_iter().filter_map(depart).collect();
    let factors = factors_of(found.iter().map(|d| &d.1), VarianceFactor::of);
    let found = found.iter();
    found
        .map(|(stone, fits, column)| (*stone, coefficient(fits, &factors, *column)))
        .collect()
}

fn continued(departures: &[(StoneId, Trend)]) -> Answer {
    let found: Vec<_> = departures
        .iter()
        .map(|(stone, departure)| (*stone, *departure, None))
        .collect();
    Answer::of(&found, Word::No, LEVEL)
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
    let velocities: Vec<_> = found.stones.iter().map(|s| (s.stone, s.velocity, None)).collect();
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

fn anomaly(
    fitted: &[Fitted],
    model: &Model,
    factors: &[VarianceFactor; 3],
    epochs: &[&SeriesEpoch],
) -> Answer {
    let step = |f: &Fitted| {
        let (step, p) = match f.step.zip(f.instead) {
            // As probable by chance as the trend in whose place it stands.
            Some((step, instead)) => (step, instead.p),
            None => likeliest_step(&f.seen, model, factors)?,
        };
        let found = Coefficient {
            value: step.value,
            sd: step.sd,
            p,
        };
        Some((f.stone, found, Some(epochs[step.epoch].name.clone())))
    };
    let found: Vec<_> = fitted.par_iter().filter_map(step).collect();
    Answer::of(&found, Word::Yes, CLAIM_LEVEL)
}
