//! The model of one stone: the terms of the wall, and a step where one is shown.

use super::basis::Term;
use super::fit::{Fit, fit};
use super::look::{Look, StoneSeries};
use super::moderated::{VarianceFactor, p_value, sd_of};
use super::terms::Model;
use nalgebra::{DMatrix, DVector, Vector3};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A coefficient: along the wall, up and out, with standard deviations of which 1.96 hold 95 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficient {
    /// Metres for each unit of the term.
    pub value: Vector3<f64>,
    /// Standard deviations, metres for each unit of the term.
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

/// A value along the wall, up and out, with standard deviations of which 1.96 hold 95 %; metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: Vector3<f64>,
    /// Its standard deviations.
    pub sd: Vector3<f64>,
}

impl Estimate {
    /// Means of values and of standard deviations, as of errors that all share; `None` of nothing.
    pub fn mean(all: &[Self]) -> Option<Self> {
        let count = all.len() as f64;
        (!all.is_empty()).then(|| Self {
            value: all.iter().map(|e| e.value).sum::<Vector3<f64>>() / count,
            sd: all.iter().map(|e| e.sd).sum::<Vector3<f64>>() / count,
        })
    }
}

/// The yearly wave in each component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// Half of what lies between its ends, metres.
    pub amplitude: Estimate,
    /// The part of the year, 0 to 1, at which it is largest.
    pub phase: Estimate,
}

/// One component of a model: coefficients of its columns with their covariance, of which 1.96 standard deviations hold
/// 95 %.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisModel {
    /// One for each column of the basis; then that of the step, where the stone has one.
    pub coefficients: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
}

impl AxisModel {
    pub(super) fn of(fit: &Fit, factor: &VarianceFactor) -> Self {
        let scale = scale_of(fit, factor);
        Self {
            coefficients: fit.coefficients.clone(),
            covariance: &fit.covariance * (scale * scale),
        }
    }

    /// The value of a row of the basis and its standard deviation. `stepped`: whether it comes after the stone's step.
    pub fn at(&self, row: &[f64], stepped: bool) -> (f64, f64) {
        let step = f64::from(u8::from(stepped));
        let full = DVector::from_fn(self.coefficients.len(), |c, _| {
            row.get(c).copied().unwrap_or(step)
        });
        let variance = full.dot(&(&self.covariance * &full));
        (full.dot(&self.coefficients), variance.max(0.0).sqrt())
    }
}

/// The yearly wave of a model whose cosine has the column `cos` and whose sine the next.
pub(super) fn wave(axes: &[AxisModel; 3], cos: usize) -> Wave {
    let of = |axis: usize| {
        let AxisModel {
            coefficients,
            covariance,
        } = &axes[axis];
        let (c, s) = (coefficients[cos], coefficients[cos + 1]);
        let (cc, ss) = (covariance[(cos, cos)], covariance[(cos + 1, cos + 1)]);
        let cs = covariance[(cos, cos + 1)];
        let amplitude = c.hypot(s).max(f64::MIN_POSITIVE);
        // Along the vector (c, s), and across it.
        let along = (c * c * cc + 2.0 * c * s * cs + s * s * ss).max(0.0).sqrt() / amplitude;
        let across = (s * s * cc - 2.0 * c * s * cs + c * c * ss).max(0.0).sqrt() / amplitude;
        let phase = (s.atan2(c) / TAU).rem_euclid(1.0);
        [[amplitude, along], [phase, across / amplitude / TAU]]
    };
    let parts = [of(0), of(1), of(2)];
    let gather = |part: usize| Estimate {
        value: Vector3::from_fn(|axis, _| parts[axis][part][0]),
        sd: Vector3::from_fn(|axis, _| parts[axis][part][1]),
    };
    Wave {
        amplitude: gather(0),
        phase: gather(1),
    }
}

/// The factor on standard deviations of what a fit says, with Student's law in it.
pub(super) fn scale_of(fit: &Fit, factor: &VarianceFactor) -> f64 {
    let (factor, freedom) = factor.at(fit.residuals, fit.freedom);
    sd_of(1.0, factor, freedom)
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
        let variance = fit.covariance[(column, column)];
        (fit.coefficients[column], variance, factor, freedom)
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

/// The design without the column of the trend, the second.
pub(super) fn without_trend(design: &DMatrix<f64>) -> DMatrix<f64> {
    design.clone().remove_column(1)
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
