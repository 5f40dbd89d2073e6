//! Everything a training needs to go on, in one file.

use super::error::TrainError;
use super::optimizer::Moments;
use super::schedule::Elapsed;
use crate::engine::Tensor;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use stonewise_io::atomic::write_atomically;

/// Where a training keeps what it needs to go on.
pub fn checkpoint_path(out: &Path) -> PathBuf {
    out.join("checkpoint.safetensors")
}

/// Version of the file's layout.
const FORMAT: u32 = 2;
/// Key of the state in the file's metadata.
const STATE: &str = "stonewise_training";
/// Beginnings of the tensors' names.
const PARAMETER: &str = "parameter/";
const MEAN: &str = "mean/";
const SQUARE: &str = "square/";

/// A training as it is saved.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint<C> {
    /// How far it has come.
    pub elapsed: Elapsed,
    /// How it is configured.
    pub config: C,
    /// Parameters of the model by name.
    pub parameters: BTreeMap<String, Tensor>,
    /// State of the optimiser by name of the parameter.
    pub moments: BTreeMap<String, Moments>,
}

#[derive(Serialize, Deserialize)]
struct State<C> {
    format: u32,
    elapsed: Elapsed,
    config: C,
}

impl<C: Serialize + for<'de> Deserialize<'de>> Checkpoint<C> {
    /// Writes the checkpoint, whole or not at all: safetensors of 32-bit floats, the rest as JSON in the
    /// metadata.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), TrainError> {
        let state = State {
            format: FORMAT,
            elapsed: self.elapsed,
            config: &self.config,
        };
        let state = serde_json::to_string(&state).map_err(|e| broken(path, e))?;
        let mut tensors: Vec<(String, Vec<usize>, Vec<u8>)> = Vec::new();
        let mut add = |name: String, shape: &[usize], values: &[f32]| {
            let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            tensors.push((name, shape.to_vec(), bytes));
        };
        for (name, tensor) in &self.parameters {
            add(format!("{PARAMETER}{name}"), tensor.shape(), tensor.values());
        }

        for (name, moments) in &self.moments {
            add(format!("{MEAN}{name}"), &[moments.mean.len()], &moments.mean);
            add(
                format!("{SQUARE}{name}"),
                &[moments.square.len()],
                &moments.square,
            );
        }

        let mut views = Vec::new();
        for (name, shape, bytes) in &tensors {
            let view = TensorView::new(Dtype::F32, shape.clone(), bytes).map_err(|e| broken(path, e))?;
            views.push((name.as_str(), view));
        }

        let metadata = HashMap::from([(STATE.to_owned(), state)]);
        let write = |partial: &Path| {
            safetensors::serialize_to_file(views, Some(metadata), partial).map_err(std::io::Error::other)
        };
        write_atomically(path, write).map_err(TrainError::io("writing the checkpoint", path))
    }

    /// Reads a checkpoint.
    ///
    /// # Errors
    /// The file cannot be read or is no checkpoint of this version.
    pub fn read(path: &Path) -> Result<Self, TrainError> {
        let bytes = std::fs::read(path).map_err(TrainError::io("reading the checkpoint", path))?;
        let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|e| broken(path, e))?;
        let state = header.metadata().as_ref().and_then(|m| m.get(STATE));
        let state =
            state.ok_or_else(|| broken(path, "it holds weights only, not the state of a training"))?;
        let state: State<C> = serde_json::from_str(state).map_err(|e| broken(path, e))?;

        if state.format != FORMAT {
            let problem = format!("its format is {}, this program's is {FORMAT}", state.format);
            return Err(broken(path, problem));
        }

        let tensors = SafeTensors::deserialize(&bytes).map_err(|e| broken(path, e))?;
        let (mut parameters, mut means, mut squares) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        for (name, view) in tensors.iter() {
            let values: Vec<f32> = view
                .data()
                .as_chunks()
                .0
                .iter()
                .map(|b| f32::from_le_bytes(*b))
                .collect();
            if let Some(name) = name.strip_prefix(PARAMETER) {
                parameters.insert(name.to_owned(), Tensor::new(view.shape(), values));
            } else if let Some(name) = name.strip_prefix(MEAN) {
                means.insert(name.to_owned(), values);
            } else if let Some(name) = name.strip_prefix(SQUARE) {
                squares.insert(name.to_owned(), values);
            }
        }

        let pairs = means.into_iter().map(|(name, mean)| {
            let square = squares.remove(&name);
            let square = square.ok_or_else(|| broken(path, format!("{SQUARE}{name} is missing")))?;
            Ok((name, Moments { mean, square }))
        });
        let moments = pairs.collect::<Result<_, TrainError>>()?;

        Ok(Self {
            elapsed: state.elapsed,
            config: state.config,
            parameters,
            moments,
        })
    }
}

fn broken(path: &Path, problem: impl ToString) -> TrainError {
    TrainError::Checkpoint {
        path: path.to_owned(),
        problem: problem.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checkpoint_comes_back_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint.safetensors");
        let weight = Tensor::new([1, 2], vec![0.1, f32::MIN_POSITIVE]);
        let moments = Moments {
            mean: vec![1.0, 2.0],
            square: vec![3.0, 4.0],
        };
        let checkpoint = Checkpoint {
            elapsed: Elapsed {
                steps: 7,
                seconds: 1.5,
            },
            config: "any".to_owned(),
            parameters: BTreeMap::from([("a.b".to_owned(), weight)]),
            moments: BTreeMap::from([("a.b".to_owned(), moments)]),
        };
        checkpoint.write(&path).unwrap();
        assert_eq!(Checkpoint::read(&path).unwrap(), checkpoint);
        std::fs::write(&path, b"nothing").unwrap();
        let error = Checkpoint::<String>::read(&path).unwrap_err().to_string();
        assert!(error.contains("checkpoint.safetensors"), "{error}");
    }
}
