//! What can stop a training.

use std::path::{Path, PathBuf};

/// Why a training could not go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainError {
    /// The loss or its gradient is no number any more.
    #[error(
        "step {step}: {what} is {value}: the training has diverged; continue from the last checkpoint with a lower \
         learning_rate (now {rate})"
    )]
    Diverged {
        /// Step, counted from 1.
        step: u64,
        /// Which quantity.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Learning rate of the step.
        rate: f64,
    },
    /// A checkpoint cannot be used.
    #[error("{}: cannot continue from this checkpoint: {problem}", path.display())]
    Checkpoint {
        /// File.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A file could not be read or written.
    #[error("{}: {action} failed: {source}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// File.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A table could not be written.
    #[error(transparent)]
    Table(#[from] stonewise_io::table::TableError),
    /// The weights could not be read or written.
    #[error(transparent)]
    Weights(#[from] crate::model::WeightsError),
    /// The detector cannot be built.
    #[error(transparent)]
    Model(#[from] crate::model::ConfigError),
    /// A parameter cannot have its value.
    #[error(transparent)]
    Params(#[from] stonewise_core::params::ParamError),
    /// Images that cannot be used.
    #[error("{0}")]
    Data(String),
}

impl TrainError {
    /// Turns a system error into one that names the file.
    pub(super) fn io<'a>(action: &'static str, path: &'a Path) -> impl FnOnce(std::io::Error) -> Self + 'a {
        move |source| Self::Io {
            action,
            path: path.to_owned(),
            source,
        }
    }
}
