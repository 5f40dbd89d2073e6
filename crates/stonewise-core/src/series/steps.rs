//! Steps of stones and of zones, and variance factors that agree with them.

use super::answers::CLAIM_LEVEL;
use super::basis::Term;
use super::fit::Fit;
use super::look::StoneSeries;
use super::moderated::VarianceFactor;
use super::stone_model::{Coefficient, Seen, Step, coefficient, likeliest_step, with_step, without_trend};
use super::terms::Model;
use super::zones::Zone;
use crate::id::StoneId;
use crate::statistics::q_values;
use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Rounds of steps and variance factors, each of which the other changes.
const ROUNDS: usize = 5;
/// Rounds in which steps and trends of all stones, and how many there are of each, follow each other.
const MIXTURE_ROUNDS: usize = 5;

/// A stone while the model is fitted.
pub(super) struct Fitted {
    pub stone: StoneId,
    pub seen: Seen,
    pub fits: [Fit; 3],
    /// Which is in the fits.
    pub step: Option<Step>,
    /// Where a zone shows the step, not the stone alone: the false discovery rate at which the zone is named.
    pub with_zone: Option<f64>,
    /// Where the step takes the place of a trend: what would be left of the trend beside it.
    pub instead: Option<Coefficient>,
}

/// Fits, steps and variance factors that agree with each other.
pub(super) struct Settled {
    pub stones: Vec<Fitted>,
    pub factors: [VarianceFactor; 3],
    pub zones: Vec<SteppedZone>,
}

/// A zone with its step, where one is shown.
pub(super) struct SteppedZone {
    pub zone: Zone,
    pub step: Option<ZoneStep>,
}

/// An abrupt motion of a zone.
pub(super) struct ZoneStep {
    /// The first epoch after it.
    pub epoch: usize,
    pub does: Coefficient,
    /// The false discovery rate at which the zone is named.
    pub q: f64,
}

impl Fitted {
    /// The design of its model, of the terms of `model` and its step but for one at `but`.
    pub fn design(&self, model: &Model, but: Option<usize>) -> DMatrix<f64> {
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

impl SteppedZone {
    /// The design of its model, of the terms of `model` and its step but for one at `but`.
    pub fn design(&self, model: &Model, but: usize) -> DMatrix<f64> {
        match &self.step {
            Some(step) if step.epoch != but => with_step(&model.design, step.epoch),
            _ => model.design.clone(),
        }
    }
}

/// Finds the steps of stones, and of the zones that pairs of epochs name, with the variance factors.
pub(super) fn settle(model: &Model, stones: &[StoneSeries], zones: &[BTreeSet<StoneId>]) -> Settled {
    let start = |stone: &StoneSeries| {
        let seen = Seen::of(stone);
        let fits = seen.fit(&model.design).filter(|f| f[0].freedom > 0)?;
        Some(Fitted {
            stone: stone.stone,
            seen,
            fits,
            step: None,
            with_zone: None,
            instead: None,
        })
    };
    let mut fitted: Vec<Fitted> = stones.par_iter().filter_map(start).collect();

    let mut zones = zones_of(zones, &fitted, model.design.nrows());
    // Steps that are not in the models yet must not count as errors that single stones have.
    let mut typical = factors_of(fitted.iter().map(|f| &f.fits), VarianceFactor::typical);
    let mut factors = typical;

    for _ in 0..ROUNDS {
        find_steps(&mut zones, model, &typical);
        let likeliest = |f: &Fitted| likeliest_step(&f.seen, model, &factors);
        let steps: Vec<Option<(Step, f64)>> = fitted.par_iter().map(likeliest).collect();
        let p: Vec<f64> = steps.iter().map(|s| s.as_ref().map_or(1.0, |s| s.1)).collect();
        let shared = steps_with_zones(model, &fitted, &factors, &zones);
        for (place, q) in q_values(&p).into_iter().enumerate() {
            let stone = &mut fitted[place];
            let own = steps[place].filter(|_| q <= CLAIM_LEVEL).map(|s| s.0);
            let shared = shared.get(&place).filter(|_| own.is_none());
            stone.step = own.or(shared.map(|s| s.0));
            stone.with_zone = shared.map(|s| s.1);
            if let Some(fits) = stone.seen.fit(&stone.design(model, None)) {
                stone.fits = fits;
            }
        }
        factors = factors_of(fitted.iter().map(|f| &f.fits), VarianceFactor::of);
        typical = factors_of(fitted.iter().map(|f| &f.fits), VarianceFactor::typical);
    }

    steps_for_trends(&mut fitted, model, &factors);
    Settled {
        stones: fitted,
        factors,
        zones,
    }
}

/// Each zone as one stone; those of few stones are left out.
fn zones_of(zones: &[BTreeSet<StoneId>], stones: &[Fitted], epochs: usize) -> Vec<SteppedZone> {
    let seen: Vec<&Seen> = stones.iter().map(|f| &f.seen).collect();
    let zone = |zone: &BTreeSet<StoneId>| {
        let members = (0..stones.len()).filter(|&i| zone.contains(&stones[i].stone));
        let zone = Zone::new(members.collect(), &seen, epochs)?;
        Some(SteppedZone { zone, step: None })
    };
    zones.iter().filter_map(zone).collect()
}

/// Gives each zone its step, where one is shown. `typical`: the variance factors of all stones.
fn find_steps(zones: &mut [SteppedZone], model: &Model, typical: &[VarianceFactor; 3]) {
    let likeliest = |z: &SteppedZone| z.zone.likeliest_step(model, typical);
    let steps: Vec<Option<(usize, Coefficient)>> = zones.iter().map(likeliest).collect();
    let p: Vec<f64> = steps.iter().map(|s| s.map_or(1.0, |s| s.1.p)).collect();
    for ((zone, step), q) in zones.iter_mut().zip(steps).zip(q_values(&p)) {
        let step = step.filter(|_| q <= CLAIM_LEVEL);
        zone.step = step.map(|(epoch, does)| ZoneStep { epoch, does, q });
    }
}

/// The steps that stones share with a zone, each with the false discovery rate at which the zone is named.
fn steps_with_zones(
    model: &Model,
    stones: &[Fitted],
    factors: &[VarianceFactor; 3],
    zones: &[SteppedZone],
) -> BTreeMap<usize, (Step, f64)> {
    let mut shared: BTreeMap<usize, (Step, f64)> = BTreeMap::new();
    for zone in zones {
        let Some(ZoneStep { epoch, does, q }) = &zone.step else {
            continue;
        };
        let (epoch, q) = (*epoch, *q);
        let design = with_step(&model.design, epoch);
        let of_stone = |place: usize| {
            let fits = stones[place].seen.fit(&design).filter(|f| f[0].freedom > 0)?;
            Some(coefficient(&fits, factors, model.unknowns()))
        };
        for (place, found) in zone.zone.taking_part(does, of_stone) {
            let step = Step {
                epoch,
                value: found.value,
                sd: found.sd,
            };
            let best = shared.entry(place).or_insert((step, q));
            if q < best.1 {
                *best = (step, q);
            }
        }
    }

    shared
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
        // Where trend and step cannot both be estimated, the uncertainty of the trend is that of the trend alone.
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
pub(super) fn factors_of<'a>(
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
