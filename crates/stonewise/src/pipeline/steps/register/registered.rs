//! Motions of a pair of epochs.

use super::tracked;
use crate::error::Result;
use crate::results::Tracks;
use crate::results::records::EstimatorRecord;
use nalgebra::{Matrix3, Point3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use stonewise_core::id::StoneId;
use stonewise_core::registration::Deformation;
use stonewise_core::registration::observers::{EpochErrors, ErrorAt};
use stonewise_core::statistics::upper_median;
use stonewise_core::stone::{NeighbourCovariance, PairResult};

/// Name of the step.
pub(super) const STEP: &str = "register";

/// Motions of a pair of epochs.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Registered {
    /// One result per matched stone, ascending by stone of the first epoch.
    pub results: Vec<PairResult>,
    /// Covariances of the motions of neighbours relative to each other; empty if the estimator gives none.
    pub neighbours: Vec<NeighbourCovariance>,
    /// What the estimator says about itself.
    pub estimator: EstimatorRecord,
    /// Error of the later epoch against the reference, as sources and stable areas show it.
    pub epoch_errors: Option<EpochErrors>,
    /// The stones at which that error is given, in its order.
    pub error_stones: Vec<StoneId>,
    /// How the wall deformed; `None` if the estimator gives no joint distribution of the motions.
    #[serde(default)]
    pub deformation: Option<Deformation>,
    /// Lowest and highest corner of the areas off the wall that both epochs show, metres; empty without
    /// `auto_stable`.
    #[serde(default)]
    pub off_wall: Vec<[Point3<f64>; 2]>,
    /// Folder of the step, once it is done.
    #[serde(skip)]
    pub folder: PathBuf,
}

impl Registered {
    /// The stones that were tracked in photos, with their pictures; `None` where photos took no part.
    pub fn tracks(&self) -> Result<Option<Tracks>> {
        tracked::read(&self.folder)
    }

    /// Error of the later epoch against the reference, by stone of the reference.
    pub fn errors(&self) -> BTreeMap<StoneId, &ErrorAt> {
        let errors = self.epoch_errors.iter().flat_map(|e| &e.at);
        self.error_stones.iter().copied().zip(errors).collect()
    }

    /// Where the datum is unknown: covariance of that error after the common rigid motion is taken off, by
    /// stone of the reference.
    pub fn relative_errors(&self) -> BTreeMap<StoneId, &Matrix3<f64>> {
        let errors = self.epoch_errors.iter().flat_map(|e| &e.relative);
        self.error_stones.iter().copied().zip(errors).collect()
    }

    /// Covariance that the scale and the photos' interior orientation give that error, by stone of the reference.
    pub fn shared_errors(&self) -> BTreeMap<StoneId, &Matrix3<f64>> {
        let errors = self.epoch_errors.iter().flat_map(|e| &e.shared);
        self.error_stones.iter().copied().zip(errors).collect()
    }

    /// The pairs of neighbours as indices into `stones`. Pairs with other stones are removed, also from the
    /// results.
    pub(super) fn neighbours_among(&mut self, stones: &[StoneId]) -> Vec<[usize; 2]> {
        let index: BTreeMap<StoneId, usize> = stones.iter().copied().zip(0..).collect();
        self.neighbours
            .retain(|pair| pair.stones.iter().all(|s| index.contains_key(s)));
        let pairs = self.neighbours.iter();
        pairs.map(|pair| pair.stones.map(|s| index[&s])).collect()
    }

    /// Adds to the covariance of each pair of neighbours that of the difference between the epochs' errors at
    /// the two stones.
    pub(super) fn add_registration(&mut self, between: &[Matrix3<f64>]) {
        for (pair, covariance) in self.neighbours.iter_mut().zip(between) {
            pair.covariance += covariance;
        }
    }

    /// Noise of single points along the normal, metres: the larger of the epochs'.
    pub(super) fn noise_m(&self) -> f64 {
        match &self.estimator {
            EstimatorRecord::Adjustment(adjustment) => {
                adjustment.noise_m.iter().flatten().copied().fold(0.0, f64::max)
            }
            EstimatorRecord::Gicp(_) => {
                let motions = self.results.iter().filter_map(|r| r.motion.as_ref().ok());
                let mut residuals: Vec<f64> = motions.map(|m| m.rmse_m).filter(|r| r.is_finite()).collect();
                upper_median(&mut residuals).unwrap_or(0.0)
            }
        }
    }
}
