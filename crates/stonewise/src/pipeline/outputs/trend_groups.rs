//! What zones and the wall do over time: their path, the model between the epochs, and the conditions beside it.

use crate::project::{ConditionsFile, Project};
use crate::results::calendar::{DAYS_A_YEAR, date_of};
use crate::results::records::{
    ConditionRecord, CurvePoint, EstimateRecord, PathPoint, SeasonRecord, ZoneTrend,
};
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::epoch::EpochId;
use stonewise_core::id::StoneId;
use stonewise_core::series::{
    Basis, Estimate, Group, SeriesEpoch, SeriesFindings, StoneSeries, Term, Trend, Wave,
};

/// Days of the curve of a zone, and of the readings of a condition, about.
const CURVE_DAYS: f64 = 240.0;
/// How far the model is drawn beyond the newest epoch, days.
const AHEAD_DAYS: f64 = DAYS_A_YEAR / 2.0;

/// A series with its model.
pub(super) struct TimedSeries<'a> {
    pub project: &'a Project,
    /// The epochs in the order of time.
    pub order: &'a [EpochId],
    pub epochs: &'a [SeriesEpoch],
    pub found: &'a SeriesFindings,
    pub stones: &'a [StoneSeries],
}

/// An epoch, or a day between epochs, with the conditions that the model takes: the first whose name has "level" or
/// "temp" in it.
pub(super) fn under(conditions: &BTreeMap<String, f64>, name: &str, day: Option<f64>) -> SeriesEpoch {
    let value = |term: Term| named(conditions.keys(), term).and_then(|name| conditions.get(name).copied());
    SeriesEpoch {
        name: name.to_owned(),
        years: day.map(|d| d / DAYS_A_YEAR),
        of_year: day.map_or(0.0, |d| (d / DAYS_A_YEAR).rem_euclid(1.0)),
        level: value(Term::Level),
        temperature: value(Term::Temperature),
    }
}

/// The condition behind a term.
fn named<'a>(mut names: impl Iterator<Item = &'a String>, term: Term) -> Option<&'a String> {
    let part = match term {
        Term::Level => "level",
        Term::Temperature => "temp",
        Term::Trend | Term::Season => return None,
    };
    names.find(|name| name.to_lowercase().contains(part))
}

impl TimedSeries<'_> {
    /// All stones of the reference that have a model.
    pub fn wall(&self, reference: &BTreeSet<StoneId>) -> Option<ZoneTrend> {
        self.of(reference, "", 0)
    }

    /// What these stones do together; `None` where none has a model.
    pub fn of(&self, stones: &BTreeSet<StoneId>, epoch: &str, zone_id: u32) -> Option<ZoneTrend> {
        let basis = self.found.basis.as_ref()?;
        let looks: BTreeMap<StoneId, &StoneSeries> = self.stones.iter().map(|s| (s.stone, s)).collect();
        let members = self.found.stones.iter().filter(|s| stones.contains(&s.stone));
        let members = members.filter_map(|s| Some((s, *looks.get(&s.stone)?))).collect();
        let group = Group::new(self.epochs, basis, members)?;
        let of_trend = |trend: &Trend| Estimate {
            value: trend.value,
            sd: trend.sd,
        };
        let velocity = group.mean(|s| Some(of_trend(&s.velocity))).unwrap_or_default();
        let departures = self.found.departures.iter().filter(|d| stones.contains(&d.0));
        let departures: Vec<Estimate> = departures.map(|d| of_trend(&d.1)).collect();
        Some(ZoneTrend {
            epoch: epoch.to_owned(),
            zone_id,
            stones: group.len(),
            confirmed_by: Vec::new(),
            velocity: velocity.value.into(),
            sd: velocity.sd.into(),
            level: group.mean(|s| s.level.as_ref().map(of_trend)).map(Into::into),
            temperature: group
                .mean(|s| s.temperature.as_ref().map(of_trend))
                .map(Into::into),
            season: group.wave().map(season),
            path: self.path(&group),
            curve: self.curve(&group, basis),
            departure: Estimate::mean(&departures).map(Into::into),
        })
    }

    fn path(&self, group: &Group) -> Vec<PathPoint> {
        let point = |(k, id): (usize, &EpochId)| {
            Some(PathPoint {
                epoch: self.epochs[k].name.clone(),
                date: self.project.epochs[*id].date.clone()?,
                measured: group.measured(k).map(Into::into),
                model: group.predicted(&self.epochs[k])?.into(),
            })
        };
        self.order.iter().enumerate().filter_map(point).collect()
    }

    fn curve(&self, group: &Group, basis: &Basis) -> Vec<CurvePoint> {
        let newest = self
            .epochs
            .iter()
            .filter_map(|e| e.years)
            .fold(f64::MIN, f64::max);
        let ranges: Vec<(Term, [f64; 2])> = basis
            .terms
            .iter()
            .filter(|t| **t != Term::Trend)
            .map(|t| (*t, range(self.epochs.iter().filter_map(|e| t.value(e)))))
            .collect();
        let point = |(date, at): (String, SeriesEpoch)| {
            let beyond = |(term, [low, high]): &(Term, [f64; 2])| {
                term.value(&at).is_some_and(|v| v < *low || v > *high)
            };
            Some(CurvePoint {
                date,
                model: group.predicted(&at)?.into(),
                extrapolated: at.years > Some(newest) || ranges.iter().any(beyond),
            })
        };
        self.days().into_iter().filter_map(point).collect()
    }

    /// Days of the series and half a year beyond, with their conditions.
    fn days(&self) -> Vec<(String, SeriesEpoch)> {
        let [first, last] = range(self.epochs.iter().filter_map(|e| e.years)).map(|y| y * DAYS_A_YEAR);
        if first > last {
            return Vec::new();
        }
        let end = last + AHEAD_DAYS;
        let step = ((end - first) / CURVE_DAYS).max(1.0);
        let count = ((end - first) / step).floor() as usize;
        let day = |k: usize| {
            let day = (first + k as f64 * step).floor();
            let date = date_of(day).unwrap_or_default();
            let conditions = self.project.conditions.as_ref();
            let values = conditions.map_or_else(BTreeMap::new, |file: &ConditionsFile| file.at(&date).values);
            let at = under(&values, &date, Some(day));
            (date, at)
        };
        (0..=count).map(day).collect()
    }

    /// Level and temperature over the time of the series.
    pub fn conditions(&self) -> Vec<ConditionRecord> {
        let days = self.days();
        let of = |term: Term| {
            let mut epochs = self.project.epochs.iter();
            let name = epochs.find_map(|e| named(e.conditions.keys(), term))?.clone();
            let of_epoch = |id: &EpochId| {
                let epoch = &self.project.epochs[*id];
                Some((epoch.date.clone()?, *epoch.conditions.get(&name)?))
            };
            let mut readings: Vec<(String, f64)> = days
                .iter()
                .filter_map(|(date, at)| Some((date.clone(), term.value(at)?)))
                .chain(self.order.iter().filter_map(of_epoch))
                .collect();
            readings.sort_by(|a, b| a.0.cmp(&b.0));
            readings.dedup_by(|a, b| a.0 == b.0);
            Some(ConditionRecord { term, name, readings })
        };
        [Term::Level, Term::Temperature]
            .into_iter()
            .filter_map(of)
            .collect()
    }
}

fn season(wave: Wave) -> SeasonRecord {
    let days = Estimate {
        value: wave.phase.value * DAYS_A_YEAR,
        sd: wave.phase.sd * DAYS_A_YEAR,
    };
    SeasonRecord {
        amplitude: wave.amplitude.into(),
        largest_on: EstimateRecord::from(days),
    }
}

/// The smallest and the largest value; the wrong way round without any.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
        [low.min(v), high.max(v)]
    })
}
