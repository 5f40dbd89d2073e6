//! The terms of the model in time, and which of them the epochs can carry.

use super::basis::{Basis, SeriesEpoch, Term};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Variance inflation beyond which a term cannot be separated from others (Marquardt 1970).
const LARGEST_INFLATION: f64 = 10.0;
/// Observations that a model with conditions leaves over, at least.
const LEAST_LEFT: usize = 2;
/// Dates whose mean direction on the circle of the year is longer than this lie within one season: half a year's circle
/// of thirty days to either side.
const ONE_SEASON: f64 = 0.85;

/// A term that a model does not have, and why.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Inseparable {
    /// The term.
    pub term: Term,
    /// Why.
    pub why: WhyInseparable,
}

/// Why a term cannot be separated from others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum WhyInseparable {
    /// These epochs lack the condition.
    NotGiven {
        /// Names of the epochs.
        epochs: Vec<String>,
    },
    /// The model needs more epochs.
    FewEpochs {
        /// Epochs that there are.
        have: usize,
        /// Epochs that it needs.
        need: usize,
    },
    /// All epochs have the same value, or lie in the same season.
    Same,
    /// All epochs lie in two seasons, which do not determine a wave.
    TwoSeasons,
    /// It goes with another term.
    GoesWith {
        /// The other one.
        other: Term,
    },
}

/// A model: a constant, the trend, and terms.
#[derive(Clone, Debug)]
pub(super) struct Model {
    /// Its columns, the trend first of the terms.
    pub basis: Basis,
    /// A row for each epoch.
    pub design: DMatrix<f64>,
}

impl Model {
    /// `terms` beside the trend. `None` where an epoch lacks a condition.
    pub fn new(epochs: &[&SeriesEpoch], terms: &[Term]) -> Option<Self> {
        let terms: Vec<Term> = [Term::Trend].into_iter().chain(terms.iter().copied()).collect();
        let basis = Basis::of(epochs, &terms)?;
        let rows: Vec<Vec<f64>> = epochs.iter().map(|e| basis.row(e)).collect::<Option<_>>()?;
        let design = DMatrix::from_fn(epochs.len(), rows.first()?.len(), |r, c| rows[r][c]);
        Some(Self { basis, design })
    }

    /// The first column of a term.
    pub fn place(&self, term: Term) -> Option<usize> {
        self.basis.place(term)
    }

    pub fn unknowns(&self) -> usize {
        self.design.ncols()
    }

    /// Whether each column can be separated from the others.
    fn is_determined(&self) -> bool {
        (1..self.unknowns()).all(|c| inflation(&self.design, c) < LARGEST_INFLATION)
    }
}

/// How much other columns raise the variance of a column's coefficient; infinite for a column that is constant.
fn inflation(design: &DMatrix<f64>, column: usize) -> f64 {
    let y = design.column(column).into_owned();
    let others = design.clone().remove_column(column);
    let total = y.add_scalar(-y.mean()).norm_squared();
    let svd = others.clone().svd(true, true);
    let Ok(solution) = svd.solve(&y, 1e-9 * svd.singular_values.max()) else {
        return f64::INFINITY;
    };
    let left = (&y - others * solution).norm_squared();
    match total > 1e-12 && left > 1e-12 * total {
        true => total / left,
        false => f64::INFINITY,
    }
}

/// Models that the epochs can carry, the one of the trend alone first, and which terms they cannot carry. Without two
/// dates there is no model.
pub(super) fn models(epochs: &[&SeriesEpoch]) -> (Vec<Model>, Vec<Inseparable>) {
    let Some(plain) = Model::new(epochs, &[]).filter(Model::is_determined) else {
        return (Vec::new(), Vec::new());
    };
    let mut refused = Vec::new();
    let mut alone = Vec::new();

    for term in Term::OTHERS {
        match carried(epochs, &plain, term) {
            Ok(()) => alone.push(term),
            Err(Some(why)) => refused.push(Inseparable { term, why }),
            Err(None) => {}
        }
    }

    let mut models = vec![plain];
    for bits in 1_u32..(1 << alone.len()) {
        let terms: Vec<Term> = (0..alone.len())
            .filter(|k| bits & (1 << k) != 0)
            .map(|k| alone[k])
            .collect();
        let Some(model) = Model::new(epochs, &terms) else {
            continue;
        };
        let need = model.unknowns() + LEAST_LEFT;
        let why = match terms.as_slice() {
            _ if epochs.len() >= need && model.is_determined() => {
                models.push(model);
                continue;
            }
            [_, _] if epochs.len() < need => WhyInseparable::FewEpochs {
                have: epochs.len(),
                need,
            },
            [other, _] => WhyInseparable::GoesWith { other: *other },
            _ => continue,
        };
        if let Some(term) = terms.last() {
            refused.push(Inseparable { term: *term, why });
        }
    }

    (models, refused)
}

/// Whether the epochs carry a term beside the trend; without a reason where the condition is given nowhere.
fn carried(epochs: &[&SeriesEpoch], plain: &Model, term: Term) -> Result<(), Option<WhyInseparable>> {
    let missing = term.missing(epochs);
    if missing.len() == epochs.len() {
        return Err(None);
    }
    let Some(model) = Model::new(epochs, &[term]) else {
        return Err(Some(WhyInseparable::NotGiven { epochs: missing }));
    };
    let need = model.unknowns() + LEAST_LEFT;
    if is_same(epochs, &model, term) {
        Err(Some(WhyInseparable::Same))
    } else if epochs.len() < need {
        Err(Some(WhyInseparable::FewEpochs {
            have: epochs.len(),
            need,
        }))
    } else if !model.is_determined() {
        // Where the term is determined without the trend, it goes with that.
        let own: Vec<usize> = (plain.unknowns()..model.unknowns()).collect();
        let without = model.design.clone().remove_column(1);
        let goes_with_trend = own.iter().all(|c| inflation(&without, c - 1) < LARGEST_INFLATION);
        Err(Some(match goes_with_trend {
            true => WhyInseparable::GoesWith { other: Term::Trend },
            false => WhyInseparable::TwoSeasons,
        }))
    } else {
        Ok(())
    }
}

fn is_same(epochs: &[&SeriesEpoch], model: &Model, term: Term) -> bool {
    let Some(first) = model.place(term) else {
        return false;
    };
    match term {
        Term::Season => {
            let mean = |c: usize| model.design.column(c).sum() / epochs.len() as f64;
            mean(first).hypot(mean(first + 1)) > ONE_SEASON
        }
        _ => model.design.column(first).amax() < 1e-9,
    }
}
