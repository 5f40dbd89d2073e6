//! The detector that comes with the program.

use crate::model::{MaskRcnn, WeightsError, config_from_bytes, model_from_bytes};
use std::path::{Path, PathBuf};

/// What the built-in detector is called where a file could be given.
const NAME: &str = "built-in";

/// Which detector finds the stones.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Weights {
    /// The one that comes with the program.
    BuiltIn,
    /// One of a file that `train` wrote.
    File(PathBuf),
}

impl Weights {
    /// The detector of this name: `built-in`, or a file.
    pub fn named(name: &Path) -> Self {
        if name == Path::new(NAME) {
            Self::BuiltIn
        } else {
            Self::File(name.to_owned())
        }
    }

    /// All bytes of the detector.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn bytes(&self) -> Result<Vec<u8>, WeightsError> {
        match self {
            Self::BuiltIn => Ok(built_in()),
            Self::File(path) => std::fs::read(path).map_err(|source| WeightsError::File {
                path: path.clone(),
                source,
            }),
        }
    }

    /// Whether the detector takes relief beside colour.
    ///
    /// # Errors
    /// The file cannot be read, or does not state its configuration.
    pub fn takes_relief(&self) -> Result<bool, WeightsError> {
        let (bytes, name) = self.named_bytes()?;
        Ok(config_from_bytes(&bytes, &name)?.relief_channels > 0)
    }

    /// All bytes, and what messages call them.
    fn named_bytes(&self) -> Result<(Vec<u8>, String), WeightsError> {
        let name = match self {
            Self::BuiltIn => NAME.to_owned(),
            Self::File(path) => path.display().to_string(),
        };
        Ok((self.bytes()?, name))
    }
}

/// The bytes of the built-in weights file, see docs/src/method/segmentation.md.
fn built_in() -> Vec<u8> {
    [stonewise_weights_1::PART, stonewise_weights_2::PART].concat()
}

/// The detector of these weights. With `relief`, weights that were trained on colour alone get input channels
/// for it.
///
/// # Errors
/// The file cannot be read or does not fit, or the model cannot take relief.
pub fn open_model(weights: &Weights, relief: bool) -> Result<MaskRcnn, WeightsError> {
    let (bytes, name) = weights.named_bytes()?;
    model_from_bytes(&bytes, &name, relief)
}
