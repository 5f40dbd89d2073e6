//! What a group of stones does over time: a zone, or the wall.

use super::analyse::StoneTrend;
use super::basis::{Basis, SeriesEpoch, Term};
use super::look::StoneSeries;
use super::stone_model::{AxisModel, Estimate, Wave, wave};
use nalgebra::{DMatrix, DVector, Vector3};

/// Stones with their looks, as one: the mean of what they do.
///
/// Standard deviations are the means of those of the stones, as if errors were common to all of them: stations and
/// strips err alike at neighbours, and a mean of more stones is not said to be more certain than one of them.
#[derive(Clone, Debug)]
pub struct Group<'a> {
    epochs: &'a [SeriesEpoch],
    basis: &'a Basis,
    members: Vec<(&'a StoneTrend, &'a StoneSeries)>,
}

impl<'a> Group<'a> {
    /// `epochs`: all, as they were analysed; `members`: not empty, or `None`.
    pub fn new(
        epochs: &'a [SeriesEpoch],
        basis: &'a Basis,
        members: Vec<(&'a StoneTrend, &'a StoneSeries)>,
    ) -> Option<Self> {
        (!members.is_empty()).then_some(Self {
            epochs,
            basis,
            members,
        })
    }

    /// How many stones it has.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Never: a group has stones.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// The mean of what a function gives for each stone.
    pub fn mean(&self, of: impl Fn(&StoneTrend) -> Option<Estimate>) -> Option<Estimate> {
        let all: Vec<Estimate> = self.members.iter().filter_map(|(stone, _)| of(stone)).collect();
        Estimate::mean(&all)
    }

    /// The yearly wave of the mean model, where the model has a season.
    pub fn wave(&self) -> Option<Wave> {
        let column = self.basis.place(Term::Season)?;
        Some(wave(&[self.axis(0), self.axis(1), self.axis(2)], column))
    }

    /// What the model says of the stones under the conditions of an epoch, which need not be one of the series; a step
    /// counts from its epoch on. `None` where a condition of the model is not known.
    pub fn predicted(&self, at: &SeriesEpoch) -> Option<Estimate> {
        let row = self.basis.row(at)?;
        let of = |(stone, _): &(&StoneTrend, &StoneSeries)| {
            let stepped = stone.step.is_some_and(|s| self.epochs[s.epoch].years <= at.years);
            let axes = [0, 1, 2].map(|axis| stone.model[axis].at(&row, stepped));
            Estimate {
                value: Vector3::from(axes.map(|a| a.0)),
                sd: Vector3::from(axes.map(|a| a.1)),
            }
        };
        let all: Vec<Estimate> = self.members.iter().map(of).collect();
        Estimate::mean(&all)
    }

    /// What an epoch shows of the stones, free of which of them it missed: the model's mean over all of them and the
    /// mean of what is left over of those that it shows. `None` where it shows none, or has no date.
    pub fn measured(&self, epoch: usize) -> Option<Estimate> {
        let at = &self.epochs[epoch];
        let row = self.basis.row(at)?;
        let left = |(stone, series): &(&StoneTrend, &StoneSeries)| {
            let look = series.looks[epoch]?;
            let stepped = stone.step.is_some_and(|s| self.epochs[s.epoch].years <= at.years);
            let model = Vector3::from([0, 1, 2].map(|axis| stone.model[axis].at(&row, stepped).0));
            Some(Estimate {
                value: look.value - model,
                sd: look.variance.map(f64::sqrt).component_mul(&stone.scale),
            })
        };
        let all: Vec<Estimate> = self.members.iter().filter_map(left).collect();
        let (left, model) = (Estimate::mean(&all)?, self.predicted(at)?);
        Some(Estimate {
            value: left.value + model.value,
            sd: left.sd,
        })
    }

    /// The mean model of a component, without steps.
    fn axis(&self, axis: usize) -> AxisModel {
        let columns = self.basis.columns();
        let count = self.members.len() as f64;
        let mut sum = AxisModel {
            coefficients: DVector::zeros(columns),
            covariance: DMatrix::zeros(columns, columns),
        };
        for (stone, _) in &self.members {
            let model = &stone.model[axis];
            sum.coefficients += model.coefficients.rows(0, columns) / count;
            sum.covariance += model.covariance.view((0, 0), (columns, columns)) / count;
        }
        sum
    }
}
