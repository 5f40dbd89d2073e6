//! The detector that comes with the program.

use crate::model::{MaskRcnn, WeightsError, config_from_bytes, model_from_bytes};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Weights trained on rendered photos, see docs/src/method/built-in-weights.md. A static, because a constant
/// would lie in the program once for each use.
static BUILT_IN: &[u8] = include_bytes!("../weights/built-in.safetensors");
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
            Self::BuiltIn => Ok(BUILT_IN.to_vec()),
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
    fn named_bytes(&self) -> Result<(Cow<'static, [u8]>, String), WeightsError> {
        Ok(match self {
            Self::BuiltIn => (Cow::Borrowed(BUILT_IN), NAME.to_owned()),
            Self::File(path) => (Cow::Owned(self.bytes()?), path.display().to_string()),
        })
    }
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
