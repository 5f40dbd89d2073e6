//! Model files that state their configuration.

use super::config::MaskRcnnConfig;
use super::kernels::ModelBackend;
use super::mask_rcnn::MaskRcnn;
use super::weights::{CONFIG_KEY, Precision, WeightsError, weights_from_bytes, weights_to_bytes};
use burn::tensor::Device;
use safetensors::tensor::SafeTensors;
use std::path::Path;
use stonewise_io::atomic::write_atomically;

/// Writes a model, whole or not at all.
///
/// # Errors
/// The file cannot be written.
pub fn save_model<B: ModelBackend>(
    model: &MaskRcnn<B>,
    path: &Path,
    precision: Precision,
) -> Result<(), WeightsError> {
    let bytes = weights_to_bytes(model, precision)?;
    write_atomically(path, |partial| std::fs::write(partial, bytes)).map_err(|source| WeightsError::File {
        path: path.to_owned(),
        source,
    })
}

/// Reads a model that [`save_model`] wrote.
///
/// # Errors
/// The file cannot be read, or does not state the configuration of its model.
pub fn load_model<B: ModelBackend>(path: &Path, device: &Device<B>) -> Result<MaskRcnn<B>, WeightsError> {
    let bytes = std::fs::read(path).map_err(|source| WeightsError::File {
        path: path.to_owned(),
        source,
    })?;
    model_from_bytes(&bytes, &path.display().to_string(), device)
}

/// A model from the bytes of its file; `name` stands for it in errors.
///
/// # Errors
/// As [`load_model`].
pub fn model_from_bytes<B: ModelBackend>(
    bytes: &[u8],
    name: &str,
    device: &Device<B>,
) -> Result<MaskRcnn<B>, WeightsError> {
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|source| WeightsError::Format {
        name: name.to_owned(),
        source,
    })?;
    let config_error = |problem: String| WeightsError::Config {
        name: name.to_owned(),
        problem,
    };
    let config = header.metadata().as_ref().and_then(|m| m.get(CONFIG_KEY));
    let config = config.ok_or_else(|| config_error("it was not written by stonewise".to_owned()))?;
    let config: MaskRcnnConfig = serde_json::from_str(config).map_err(|e| config_error(e.to_string()))?;
    let model = MaskRcnn::init(&config, 0, device).map_err(|e| config_error(e.to_string()))?;
    weights_from_bytes(model, bytes, name)
}
