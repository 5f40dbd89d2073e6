//! What can stop the writing of a simulated survey.

use std::path::PathBuf;
use stonewise_core::progress::Interrupted;
use stonewise_io::cameras::CameraError;
use stonewise_io::cloud::CloudError;
use stonewise_io::image_io::ImageIoError;
use stonewise_io::masks::MaskError;
use stonewise_io::table::TableError;

/// Why a simulated survey was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// A parameter has no possible meaning.
    #[error("{key} = {value} is not possible: {needed}")]
    Parameter {
        /// Name of the parameter, with the tables it lies in.
        key: &'static str,
        /// Its value.
        value: String,
        /// What is possible.
        needed: &'static str,
    },
    /// The folder holds a project that was not simulated.
    #[error("{}: the folder already holds a project of its own, choose another", path.display())]
    Occupied {
        /// The folder.
        path: PathBuf,
    },
    /// A folder or a text file cannot be written.
    #[error("{}: cannot write: {source}", path.display())]
    Write {
        /// File or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Parameters cannot be written as TOML.
    #[error("cannot write parameters: {0}")]
    Toml(#[from] toml::ser::Error),
    /// Stopped by the caller.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
    /// A cloud cannot be written.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// Cameras cannot be written.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// Masks cannot be written.
    #[error(transparent)]
    Mask(#[from] MaskError),
    /// A photo cannot be written.
    #[error(transparent)]
    Image(#[from] ImageIoError),
    /// A table cannot be written.
    #[error(transparent)]
    Table(#[from] TableError),
}
