//! Model files that state their configuration.

use super::config::MaskRcnnConfig;
use super::mask_rcnn::MaskRcnn;
use super::weights::{CONFIG_KEY, Precision, WeightsError, weights_from_bytes, weights_to_bytes};
use safetensors::tensor::SafeTensors;
use std::path::Path;
use stonewise_io::atomic::write_atomically;

/// Writes a model, whole or not at all.
///
/// # Errors
/// The file cannot be written.
pub fn save_model(model: &MaskRcnn, path: &Path, precision: Precision) -> Result<(), WeightsError> {
    let bytes = weights_to_bytes(model, precision)?;
    write_atomically(path, |partial| std::fs::write(partial, bytes)).map_err(|source| WeightsError::File {
        path: path.to_owned(),
        source,
    })
}

/// A model from the bytes of its file; `name` stands for it in errors. `relief`: it takes relief, with
/// weights of zero where the file has none.
///
/// # Errors
/// The file cannot be read, or does not state the configuration of its model.
pub fn model_from_bytes(bytes: &[u8], name: &str, relief: bool) -> Result<MaskRcnn, WeightsError> {
    let config = config_from_bytes(bytes, name)?;
    let config = if relief { config.with_relief() } else { config };
    let model = MaskRcnn::zeros(&config).map_err(|e| config_error(name, &e))?;
    weights_from_bytes(model, bytes, name)
}

/// What the model of a file looks like; `name` stands for the file in errors.
///
/// # Errors
/// It is no safetensors file, or does not state the configuration of its model.
pub fn config_from_bytes(bytes: &[u8], name: &str) -> Result<MaskRcnnConfig, WeightsError> {
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|source| WeightsError::Format {
        name: name.to_owned(),
        source,
    })?;
    let config = header.metadata().as_ref().and_then(|m| m.get(CONFIG_KEY));
    let config = config.ok_or_else(|| config_error(name, &"it was not written by stonewise"))?;
    serde_json::from_str(config).map_err(|e| config_error(name, &e))
}

fn config_error(name: &str, problem: &dyn std::fmt::Display) -> WeightsError {
    WeightsError::Config {
        name: name.to_owned(),
        problem: problem.to_string(),
    }
}
