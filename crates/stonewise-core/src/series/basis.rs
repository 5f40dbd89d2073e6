//! What moves a wall besides chance, as functions of an epoch: the columns of the model.

use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// An epoch as the model in time sees it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SeriesEpoch {
    /// Its name.
    pub name: String,
    /// Its date as years since any day; `None`: not dated.
    pub years: Option<f64>,
    /// The part of the year that has passed, 0 to 1.
    pub of_year: f64,
    /// Level of the reservoir, metres.
    pub level: Option<f64>,
    /// Temperature, degrees.
    pub temperature: Option<f64>,
}

/// What moves a stone besides chance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Term {
    /// In proportion to time.
    Trend,
    /// In proportion to the level of the reservoir.
    Level,
    /// In proportion to the temperature.
    Temperature,
    /// One wave a year.
    Season,
}

impl Term {
    /// Terms beside the trend, in the order in which they are tried.
    pub const OTHERS: [Self; 3] = [Self::Level, Self::Temperature, Self::Season];

    /// What an epoch says of a term that is in proportion to a value; `None` for the season, and where the value is not
    /// known.
    pub fn value(self, epoch: &SeriesEpoch) -> Option<f64> {
        match self {
            Self::Trend => epoch.years,
            Self::Level => epoch.level,
            Self::Temperature => epoch.temperature,
            Self::Season => None,
        }
    }

    /// Names of the epochs that lack its condition.
    pub(super) fn missing(self, epochs: &[&SeriesEpoch]) -> Vec<String> {
        let lacks = |e: &&&SeriesEpoch| match self {
            Self::Trend | Self::Season => false,
            Self::Level | Self::Temperature => self.value(e).is_none(),
        };
        epochs.iter().filter(lacks).map(|e| e.name.clone()).collect()
    }
}

/// The columns of a model: a one, the terms that go in proportion to a value about its mean over the epochs, and the two
/// waves of the season.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Basis {
    /// Its terms in the order of the columns, the season last.
    pub terms: Vec<Term>,
    /// Value of each term at which its column is zero: the mean over the epochs, 0 of the season.
    pub zero: Vec<f64>,
}

impl Basis {
    /// The columns of these terms. `None` where an epoch lacks a condition.
    pub(super) fn of(epochs: &[&SeriesEpoch], terms: &[Term]) -> Option<Self> {
        let zero = |term: &Term| {
            if *term == Term::Season {
                return Some(0.0);
            }
            let values: Option<Vec<f64>> = epochs.iter().map(|e| term.value(e)).collect();
            // About the mean, so that the constant stays the motion under mean conditions.
            values.map(|v| v.iter().sum::<f64>() / v.len().max(1) as f64)
        };
        Some(Self {
            terms: terms.to_vec(),
            zero: terms.iter().map(zero).collect::<Option<_>>()?,
        })
    }

    /// The row of an epoch. `None` where it lacks a condition.
    pub fn row(&self, epoch: &SeriesEpoch) -> Option<Vec<f64>> {
        let mut row = vec![1.0];
        for (term, zero) in self.terms.iter().zip(&self.zero) {
            match term {
                Term::Season => {
                    let (sin, cos) = (TAU * epoch.of_year).sin_cos();
                    row.extend([cos, sin]);
                }
                _ => row.push(term.value(epoch)? - zero),
            }
        }
        Some(row)
    }

    /// How many columns it has.
    pub(super) fn columns(&self) -> usize {
        1 + self.terms.len() + usize::from(self.terms.contains(&Term::Season))
    }

    /// The first column of a term.
    pub(super) fn place(&self, term: Term) -> Option<usize> {
        // Only the season has two columns, and it is the last.
        self.terms
            .iter()
            .position(|t| *t == term)
            .map(|before| 1 + before)
    }
}
