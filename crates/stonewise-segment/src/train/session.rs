//! A training on the backend that the program was built with.

use super::error::TrainError;
use super::params::{TrainConfig, TrainParams};
use super::run::{Run, Stop};
use super::schedule::{Elapsed, Total};
use super::start::{Start, open_training};
use super::trainer::Trainer;
use crate::backend::{Training, device};
use std::path::Path;

/// A training on [`Training`]; as [`StoneFinder`](crate::StoneFinder), it is compiled with this crate, once.
pub struct Session(Trainer<Training>);

impl Session {
    /// Takes up the training in a folder, or starts one where there is none; see [`open_training`].
    ///
    /// # Errors
    /// As [`open_training`].
    pub fn open(
        out: &Path,
        start: &Start,
        params: Option<TrainParams>,
        total: Option<Total>,
        minutes: Option<f64>,
    ) -> Result<Self, TrainError> {
        Ok(Self(open_training(
            out,
            start,
            params,
            total,
            minutes,
            &device(),
        )?))
    }

    /// Steps and time so far.
    pub fn elapsed(&self) -> &Elapsed {
        self.0.elapsed()
    }

    /// The parameters that it was started with.
    pub fn config(&self) -> &TrainConfig {
        self.0.config()
    }

    /// Trains as [`Run::train`] does.
    ///
    /// # Errors
    /// As [`Run::train`].
    pub fn train(&mut self, run: &Run) -> Result<Stop, TrainError> {
        run.train(&mut self.0)
    }
}
