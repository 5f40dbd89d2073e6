//! Weights as safetensors with torchvision's names, in single or half precision.

use super::mask_rcnn::MaskRcnn;
use crate::engine::Tensor;
use half::{bf16, f16};
use safetensors::tensor::{Dtype, SafeTensorError, SafeTensors, TensorView};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

/// Key of the model's configuration in a file's metadata.
pub(super) const CONFIG_KEY: &str = "stonewise_model";

/// Beginnings of the names of weights of relief, which files of colour alone do not have: of a residual network, of the
/// stem of relief, and of what takes the stem's results to the pyramid.
const RELIEF: [&str; 3] = [
    "backbone.body.relief.",
    "backbone.relief.",
    "backbone.relief.laterals.",
];

/// How weights are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 32 bits.
    Single,
    /// 16 bits.
    Half,
}

/// Weights that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WeightsError {
    /// The file could not be read or written.
    #[error("weights file {path}")]
    File {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        source: std::io::Error,
    },
    /// Not a safetensors file.
    #[error("{name} is not a safetensors file")]
    Format {
        /// The file or what stands for it.
        name: String,
        /// What went wrong.
        source: SafeTensorError,
    },
    /// The file does not state the configuration of its model.
    #[error("{name} does not state the configuration of its model: {problem}")]
    Config {
        /// The file or what stands for it.
        name: String,
        /// What is wrong.
        problem: String,
    },
    /// A parameter of the model is not in the file.
    #[error(
        "{name} has no tensor \"{key}\", which the model needs; is it of another depth or of another model?"
    )]
    Missing {
        /// The file or what stands for it.
        name: String,
        /// The parameter.
        key: String,
    },
    /// A tensor has another shape than the model's parameter.
    #[error(
        "{name}: tensor \"{key}\" has shape {found:?}, the model's is {expected:?}; the configurations differ"
    )]
    Shape {
        /// The file or what stands for it.
        name: String,
        /// The parameter.
        key: String,
        /// Shape in the file.
        found: Vec<usize>,
        /// Shape in the model.
        expected: Vec<usize>,
    },
    /// A tensor holds something else than floating-point numbers.
    #[error("{name}: tensor \"{key}\" holds {found:?}; F32, F16 or BF16 is needed")]
    Kind {
        /// The file or what stands for it.
        name: String,
        /// The parameter.
        key: String,
        /// What it holds.
        found: Dtype,
    },
    /// A tensor of the file belongs to no parameter of the model.
    #[error(
        "{name} has a tensor \"{key}\" that the model does not have; is it of another depth or of another model?"
    )]
    Unknown {
        /// The file or what stands for it.
        name: String,
        /// The tensor.
        key: String,
    },
}

/// Replaces all parameters of a model by those of a file. A file of colour alone fits a model with relief,
/// too: the convolutions whose output is added become zeros, and the model does what it did without.
///
/// # Errors
/// The file cannot be read, lacks a parameter, has one too many or one of another shape.
pub fn load_weights(model: MaskRcnn, path: &Path) -> Result<MaskRcnn, WeightsError> {
    let bytes = std::fs::read(path).map_err(|source| WeightsError::File {
        path: path.to_owned(),
        source,
    })?;
    weights_from_bytes(model, &bytes, &path.display().to_string())
}

/// Writes all parameters of a model to a file.
///
/// # Errors
/// The file cannot be written.
pub fn save_weights(model: &MaskRcnn, path: &Path, precision: Precision) -> Result<(), WeightsError> {
    let bytes = weights_to_bytes(model, precision)?;
    std::fs::write(path, bytes).map_err(|source| WeightsError::File {
        path: path.to_owned(),
        source,
    })
}

/// Replaces all parameters of a model by those of a safetensors file in memory; `name` stands for it in
/// errors.
///
/// # Errors
/// As [`load_weights`].
pub fn weights_from_bytes(mut model: MaskRcnn, bytes: &[u8], name: &str) -> Result<MaskRcnn, WeightsError> {
    let file = SafeTensors::deserialize(bytes).map_err(|source| WeightsError::Format {
        name: name.to_owned(),
        source,
    })?;
    let mut tensors = BTreeMap::new();
    for (key, view) in file.tensors() {
        if !key.ends_with("num_batches_tracked") {
            tensors.insert(current_name(&key), view);
        }
    }
    let of_relief = |key: &str, names: &[&str]| names.iter().any(|name| key.starts_with(name));
    let is_colour_alone = !tensors.keys().any(|key| of_relief(key, &RELIEF));
    for (key, param) in model.parameters() {
        let shape = param.tensor.shape().to_vec();
        let values = match tensors.remove(&key) {
            Some(view) => values_of(&view, name, key, &shape)?,
            // Weights that have not learnt relief: it makes no difference.
            None if is_colour_alone && of_relief(&key, &[RELIEF[0], RELIEF[2]]) => {
                vec![0.0; shape.iter().product()]
            }
            None if is_colour_alone && of_relief(&key, &RELIEF) => continue,
            None => {
                return Err(WeightsError::Missing {
                    name: name.to_owned(),
                    key,
                });
            }
        };
        param.tensor = Tensor::new(shape, values);
    }
    match tensors.into_keys().next() {
        None => Ok(model),
        Some(key) => Err(WeightsError::Unknown {
            name: name.to_owned(),
            key,
        }),
    }
}

/// All parameters of a model as a safetensors file.
///
/// # Errors
/// The format cannot hold them.
pub fn weights_to_bytes(model: &MaskRcnn, precision: Precision) -> Result<Vec<u8>, WeightsError> {
    let mut copy = model.clone();
    let tensors = copy.parameters().into_iter().map(|(key, param)| {
        let values = param.tensor.values().iter();
        let bytes: Vec<u8> = match precision {
            Precision::Single => values.flat_map(|value| value.to_le_bytes()).collect(),
            Precision::Half => values
                .flat_map(|value| f16::from_f32(*value).to_le_bytes())
                .collect(),
        };
        (key, (param.tensor.shape().to_vec(), bytes))
    });
    let tensors: BTreeMap<_, _> = tensors.collect();
    let dtype = match precision {
        Precision::Single => Dtype::F32,
        Precision::Half => Dtype::F16,
    };
    let format = |source| WeightsError::Format {
        name: "the model".to_owned(),
        source,
    };
    let views = tensors
        .iter()
        .map(|(key, (shape, bytes))| Ok((key, TensorView::new(dtype, shape.clone(), bytes)?)))
        .collect::<Result<Vec<_>, SafeTensorError>>()
        .map_err(format)?;
    let config = serde_json::to_string(model.config()).map_err(|e| WeightsError::Config {
        name: "the model".to_owned(),
        problem: e.to_string(),
    })?;
    let metadata = HashMap::from([(CONFIG_KEY.to_owned(), config)]);
    safetensors::serialize(views, Some(metadata)).map_err(format)
}

/// Today's name for a parameter under the name that torchvision's released files of before 2022 give it.
fn current_name(key: &str) -> String {
    if let Some(rest) = key.strip_prefix("rpn.head.conv.")
        && !rest.starts_with("0.")
    {
        return format!("rpn.head.conv.0.0.{rest}");
    }
    if let Some(rest) = key.strip_prefix("roi_heads.mask_head.mask_fcn")
        && let Some((place, rest)) = rest.split_once('.')
        && let Some(place) = place.parse::<usize>().ok().and_then(|place| place.checked_sub(1))
    {
        return format!("roi_heads.mask_head.{place}.0.{rest}");
    }
    if key.starts_with("backbone.fpn.")
        && let [a, b, c, place, kind @ ("weight" | "bias")] = key.split('.').collect::<Vec<_>>()[..]
    {
        return format!("{a}.{b}.{c}.{place}.0.{kind}");
    }
    key.to_owned()
}

/// The values of a file's tensor; `name` and `key` stand for both in errors.
fn values_of(view: &TensorView, name: &str, key: String, shape: &[usize]) -> Result<Vec<f32>, WeightsError> {
    let name = name.to_owned();
    if view.shape() != shape {
        return Err(WeightsError::Shape {
            name,
            key,
            found: view.shape().to_vec(),
            expected: shape.to_vec(),
        });
    }
    let bytes = view.data();
    let fours = bytes.as_chunks::<4>().0.iter();
    let pairs = bytes.as_chunks::<2>().0.iter();
    Ok(match view.dtype() {
        Dtype::F32 => fours.map(|&bytes| f32::from_le_bytes(bytes)).collect(),
        Dtype::F16 => pairs.map(|&bytes| f16::from_le_bytes(bytes).to_f32()).collect(),
        Dtype::BF16 => pairs.map(|&bytes| bf16::from_le_bytes(bytes).to_f32()).collect(),
        found => return Err(WeightsError::Kind { name, key, found }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_names_become_new_ones() {
        let cases = [
            ("rpn.head.conv.weight", "rpn.head.conv.0.0.weight"),
            ("rpn.head.conv.0.0.bias", "rpn.head.conv.0.0.bias"),
            (
                "roi_heads.mask_head.mask_fcn3.bias",
                "roi_heads.mask_head.2.0.bias",
            ),
            (
                "backbone.fpn.inner_blocks.2.weight",
                "backbone.fpn.inner_blocks.2.0.weight",
            ),
            (
                "backbone.fpn.layer_blocks.0.0.bias",
                "backbone.fpn.layer_blocks.0.0.bias",
            ),
            (
                "backbone.body.layer1.0.conv1.weight",
                "backbone.body.layer1.0.conv1.weight",
            ),
        ];
        for (old, new) in cases {
            assert_eq!(current_name(old), new);
        }
    }
}
