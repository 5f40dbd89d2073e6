//! The model of one stone: the terms of the wall, and a step where one is shown.

use super::fit::{Fit, fit};
use super::look::{Look, StoneSeries};
use super::moderated::{VarianceFactor, p_value, sd_of};
use super::terms::{Model, Term};
use nalgebra::{DMatrix, Vector3};
use serde::{Deserialize, Serialize};

/// A coefficient: along the wall, up and out, with standard deviations of which 1.96 hold 95 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficient {
    /// Metres for each unit of the term.
    pub value: Vector3<f64>,
    /// The same.
    pub sd: Vector3<f64>,
    /// Probability of so large a value by chance, in the least probable of the three components, times three.
    pub p: f64,
}

/// An abrupt motion between two epochs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// The first epoch after it, by its place among the epochs given.
    pub epoch: usize,
    /// Along the wall, up and out, metres.
    pub value: Vector3<f64>,
    /// Standard deviations.
    pub sd: Vector3<f64>,
}

/// The epochs that saw a stone, with what they saw.
pub(super) struct Seen {
    pub epochs: Vec<usize>,
    pub looks: Vec<Look>,
}

impl Seen {
    pub fn of(stone: &StoneSeries) -> Self {
        let seen = stone.looks.iter().enumerate();
        let (epochs, looks) = seen.filter_map(|(e, look)| Some((e, (*look)?))).unzip();
        Self { epochs, looks }
    }

    /// The rows of a design that belong to these epochs.
    fn rows(&self, design: &DMatrix<f64>) -> DMatrix<f64> {
        design.select_rows(&self.epochs)
    }

    /// The three components fitted by a design of all epochs.
    pub fn fit(&self, design: &DMatrix<f64>) -> Option<[Fit; 3]> {
        let design = self.rows(design);
        let component = |axis: usize| {
            let values: Vec<f64> = self.looks.iter().map(|l| l.value[axis]).collect();
            let variances: Vec<f64> = self.looks.iter().map(|l| l.variance[axis]).collect();
            fit(&design, &values, &variances)
        };
        Some([component(0)?, component(1)?, component(2)?])
    }
}

/// A coefficient of three fits.
pub(super) fn coefficient(fits: &[Fit; 3], factors: &[VarianceFactor; 3], column: usize) -> Coefficient {
    let at = |axis: usize| {
        let fit = &fits[axis];
        let (factor, freedom) = factors[axis].at(fit.residuals, fit.freedom);
        (fit.coefficients[column], fit.variances[column], factor, freedom)
    };
    let p = |axis: usize| {
        let (value, variance, factor, freedom) = at(axis);
        p_value(value, variance, factor, freedom)
    };
    Coefficient {
        value: Vector3::from_fn(|axis, _| at(axis).0),
        sd: Vector3::from_fn(|axis, _| {
            let (_, variance, factor, freedom) = at(axis);
            sd_of(variance, factor, freedom)
        }),
        p: (3.0 * p(0).min(p(1)).min(p(2))).min(1.0),
    }
}

/// The design with a column that is one from `epoch` on.
pub(super) fn with_step(design: &DMatrix<f64>, epoch: usize) -> DMatrix<f64> {
    let last = design.ncols();
    let mut with = design.clone().insert_column(last, 0.0);
    (epoch..design.nrows()).for_each(|row| with[(row, last)] = 1.0);
    with
}

/// The most probable step of a stone and its probability by chance, over all places and components. `None` where no
/// step leaves an observation over.
pub(super) fn likeliest_step(
    seen: &Seen,
    model: &Model,
    factors: &[VarianceFactor; 3],
) -> Option<(Step, f64)> {
    if seen.epochs.len() < model.unknowns() + 2 {
        return None;
    }
    let column = model.unknowns();
    let places = seen.epochs.len() - 1;
    let at = |k: &usize| {
        let epoch = seen.epochs[*k];
        let fits = seen.fit(&with_step(&model.design, epoch))?;
        let found = coefficient(&fits, factors, column);
        let step = Step {
            epoch,
            value: found.value,
            sd: found.sd,
        };
        Some((step, found.p))
    };
    let all: Vec<usize> = (1..seen.epochs.len()).collect();
    let best = all.iter().filter_map(at).min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((best.0, (best.1 * places as f64).min(1.0)))
}

/// The coefficient of a term, the second one of the season as well.
pub(super) fn of_term(
    fits: &[Fit; 3],
    factors: &[VarianceFactor; 3],
    model: &Model,
    term: Term,
) -> Option<Coefficient> {
    model.place(term).map(|column| coefficient(fits, factors, column))
}
