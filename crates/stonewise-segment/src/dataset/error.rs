//! Why labelled photos cannot be used.

use crate::SampleError;
use std::path::PathBuf;
use stonewise_io::image_io::ImageIoError;
use stonewise_io::masks::MaskError;

/// Why labelled photos cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// A photo cannot be read.
    #[error(transparent)]
    Image(#[from] ImageIoError),
    /// The masks cannot be read.
    #[error(transparent)]
    Masks(#[from] MaskError),
    /// No photo of the folder has masks.
    #[error("none of the photos ({photos}) in {} has masks in {}: the file names must be the same", folder.display(), masks.display())]
    NoneLabelled {
        /// Number of photos in the folder.
        photos: usize,
        /// The folder.
        folder: PathBuf,
        /// The masks.
        masks: PathBuf,
    },
    /// Masks and photo do not fit.
    #[error(transparent)]
    Sample(#[from] SampleError),
    /// Another set of photos cannot be read.
    #[error(transparent)]
    Other(Box<dyn std::error::Error + Send + Sync>),
}
