//! Weights as safetensors with torchvision's names, in single or half precision.

use super::kernels::ModelBackend;
use super::mask_rcnn::MaskRcnn;
use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};
use half::{bf16, f16};
use safetensors::tensor::{Dtype, SafeTensorError, SafeTensors, TensorView};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};

/// Key of the model's configuration in a file's metadata.
pub(super) const CONFIG_KEY: &str = "stonewise_model";

/// Name of the weights of relief, which files of colour alone do not have.
const RELIEF_KEY: &str = "backbone.body.relief.weight";

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
/// too: the weights of relief become zeros, and the model does what it did without.
///
/// # Errors
/// The file cannot be read, lacks a parameter, has one too many or one of another shape.
pub fn load_weights<B: ModelBackend>(model: MaskRcnn<B>, path: &Path) -> Result<MaskRcnn<B>, WeightsError> {
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
pub fn save_weights<B: ModelBackend>(
    model: &MaskRcnn<B>,
    path: &Path,
    precision: Precision,
) -> Result<(), WeightsError> {
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
pub fn weights_from_bytes<B: ModelBackend>(
    model: MaskRcnn<B>,
    bytes: &[u8],
    name: &str,
) -> Result<MaskRcnn<B>, WeightsError> {
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
    let mut reader = Reader {
        path: Vec::new(),
        tensors,
        used: BTreeSet::new(),
        name,
        error: None,
    };
    let model = model.map(&mut reader);
    if let Some(error) = reader.error {
        return Err(error);
    }
    if let Some(key) = reader.tensors.keys().find(|key| !reader.used.contains(*key)) {
        return Err(WeightsError::Unknown {
            name: name.to_owned(),
            key: key.clone(),
        });
    }
    Ok(model)
}

/// All parameters of a model as a safetensors file.
///
/// # Errors
/// The format cannot hold them.
pub fn weights_to_bytes<B: ModelBackend>(
    model: &MaskRcnn<B>,
    precision: Precision,
) -> Result<Vec<u8>, WeightsError> {
    let mut writer = Writer {
        path: Vec::new(),
        precision,
        tensors: BTreeMap::new(),
    };
    model.visit(&mut writer);
    let dtype = match precision {
        Precision::Single => Dtype::F32,
        Precision::Half => Dtype::F16,
    };
    let format = |source| WeightsError::Format {
        name: "the model".to_owned(),
        source,
    };
    let views = writer
        .tensors
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

/// torchvision's name of a parameter: its lists hold (convolution, normalisation) pairs without names.
fn key_of(path: &[String]) -> String {
    let part = |part: &String| match part.as_str() {
        "conv" => "0".to_owned(),
        "norm" => "1".to_owned(),
        "hidden" => "conv".to_owned(),
        _ => part.clone(),
    };
    path.iter().map(part).collect::<Vec<_>>().join(".")
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

struct Writer {
    path: Vec<String>,
    precision: Precision,
    tensors: BTreeMap<String, (Vec<usize>, Vec<u8>)>,
}

impl<B: Backend> ModuleVisitor<B> for Writer {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        let values = param.val().into_data();
        let bytes = match self.precision {
            Precision::Single => values.iter::<f32>().flat_map(f32::to_le_bytes).collect(),
            Precision::Half => values
                .iter::<f32>()
                .flat_map(|value| f16::from_f32(value).to_le_bytes())
                .collect(),
        };
        let shape = param.val().dims().to_vec();
        self.tensors.insert(key_of(&self.path), (shape, bytes));
    }
}

struct Reader<'a> {
    path: Vec<String>,
    tensors: BTreeMap<String, TensorView<'a>>,
    used: BTreeSet<String>,
    name: &'a str,
    error: Option<WeightsError>,
}

impl Reader<'_> {
    /// The values that the file has for the parameter at the present path.
    fn values(&mut self, expected: Vec<usize>) -> Result<TensorData, WeightsError> {
        let key = key_of(&self.path);
        let name = self.name.to_owned();
        let Some(view) = self.tensors.get(&key) else {
            if key == RELIEF_KEY {
                // Weights that have not learnt relief: it makes no difference.
                let count = expected.iter().product();
                return Ok(TensorData::new(vec![0.0f32; count], expected));
            }
            return Err(WeightsError::Missing { name, key });
        };
        if view.shape() != expected {
            let found = view.shape().to_vec();
            return Err(WeightsError::Shape {
                name,
                key,
                found,
                expected,
            });
        }
        let bytes = view.data();
        let pairs = bytes.as_chunks::<2>().0.iter();
        let values: Vec<f32> = match view.dtype() {
            Dtype::F32 => bytes
                .as_chunks()
                .0
                .iter()
                .map(|&bytes| f32::from_le_bytes(bytes))
                .collect(),
            Dtype::F16 => pairs.map(|&bytes| f16::from_le_bytes(bytes).to_f32()).collect(),
            Dtype::BF16 => pairs.map(|&bytes| bf16::from_le_bytes(bytes).to_f32()).collect(),
            found => return Err(WeightsError::Kind { name, key, found }),
        };
        self.used.insert(key);
        Ok(TensorData::new(values, expected))
    }
}

impl<B: Backend> ModuleMapper<B> for Reader<'_> {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        if self.error.is_some() {
            return param;
        }
        let expected = param.val().dims().to_vec();
        match self.values(expected) {
            Ok(values) => param.map(|tensor| {
                let trained = tensor.is_require_grad();
                Tensor::from_data(values, &tensor.device()).set_require_grad(trained)
            }),
            Err(error) => {
                self.error = Some(error);
                param
            }
        }
    }
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
