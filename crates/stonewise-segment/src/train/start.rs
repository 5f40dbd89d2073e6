//! The beginning of a training, or of another run of one.

use super::checkpoint::checkpoint_path;
use super::error::TrainError;
use super::params::{TrainConfig, TrainParams};
use super::schedule::Total;
use super::trainer::Trainer;
use crate::built_in::{Weights, open_model};
use crate::model::{MaskRcnn, MaskRcnnConfig};
use std::path::Path;
use stonewise_core::params::Params;

/// What a training starts from.
#[derive(Clone, Debug, PartialEq)]
pub enum Start {
    /// Random weights of a detector that looks like this.
    Nothing(Box<MaskRcnnConfig>),
    /// A detector that has learnt before.
    Weights(Weights),
}

/// Default duration of a training, minutes: enough to learn a wall from a few labelled photos on two CPU cores.
const DEFAULT_MINUTES: f64 = 30.0;

/// Takes up the training in a folder, or starts one where there is none.
///
/// A training goes on under the parameters that it was started with; `total`, where given, replaces how long
/// it lasts in all. A new one without a total lasts for the `minutes` of its first run.
///
/// # Errors
/// The folder holds a training with other parameters, the weights cannot be read, or a parameter is
/// impossible.
pub fn open_training(
    out: &Path,
    start: &Start,
    params: Option<TrainParams>,
    total: Option<Total>,
    minutes: Option<f64>,
) -> Result<Trainer, TrainError> {
    let path = checkpoint_path(out);
    if path.exists() {
        let mut trainer = Trainer::resume(&path)?;
        if params.is_some_and(|p| p != trainer.config().training) {
            return Err(TrainError::Checkpoint {
                path,
                problem: "it was started with other parameters: leave --config away to continue it, or give another \
                          folder to start anew"
                    .to_owned(),
            });
        }
        if let Some(total) = total {
            trainer.set_total(total);
        }
        return Ok(trainer);
    }

    let training = params.unwrap_or_else(|| match start {
        Start::Nothing(_) => TrainParams::default(),
        Start::Weights(_) => TrainParams::fine_tuning(),
    });
    training.check()?;
    let model = match start {
        Start::Nothing(config) => {
            let config = MaskRcnnConfig::clone(config);
            let config = if training.relief {
                config.with_relief()
            } else {
                config
            };
            MaskRcnn::init(&config, training.seed)?
        }
        Start::Weights(weights) => open_model(weights, training.relief)?,
    };

    let config = TrainConfig {
        model: model.config().clone(),
        training,
        total: total.unwrap_or(Total::Minutes(minutes.unwrap_or(DEFAULT_MINUTES))),
    };
    Trainer::new(config, model)
}
