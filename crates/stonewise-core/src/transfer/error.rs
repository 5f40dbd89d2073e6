//! Why labels could not be transferred.

use crate::params::ParamError;
use crate::progress::Interrupted;

type Source = Box<dyn std::error::Error + Send + Sync>;

/// Why labels could not be transferred, or stones not be tabulated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TransferError {
    /// A tile of the cloud could not be read.
    #[error("cannot read tile {tile} of the cloud")]
    Tile {
        /// Index of the tile.
        tile: usize,
        /// What went wrong.
        source: Source,
    },
    /// The mask of a photo could not be read.
    #[error("cannot read the mask of photo {photo}")]
    Mask {
        /// Name of the photo.
        photo: String,
        /// What went wrong.
        source: Source,
    },
    /// A mask belongs to another photo, or was made at another resolution.
    #[error(
        "mask of photo {photo} is {}x{} pixels, its camera {}x{}: segment the photo at full size",
        .mask[0], .mask[1], .camera[0], .camera[1]
    )]
    MaskSize {
        /// Name of the photo.
        photo: String,
        /// Width and height of the mask, pixels.
        mask: [u32; 2],
        /// Width and height that the camera states, pixels.
        camera: [u32; 2],
    },
    /// No photo has a mask, so nothing can be labelled.
    #[error("none of the photos ({photos}) has a mask")]
    NoMasks {
        /// Number of photos.
        photos: usize,
    },
    /// The labels of a tile could not be kept or found again.
    #[error("cannot store the labels of tile {tile}")]
    Labels {
        /// Index of the tile.
        tile: usize,
        /// What went wrong.
        source: Source,
    },
    /// The stored labels do not belong to this cloud.
    #[error("tile {tile} has {points} points but {labels} labels: label the cloud again")]
    LabelCount {
        /// Index of the tile.
        tile: usize,
        /// Points of the tile.
        points: usize,
        /// Labels stored for it.
        labels: usize,
    },
    /// A parameter cannot have its value.
    #[error(transparent)]
    Params(#[from] ParamError),
    /// The caller stopped the work.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

impl TransferError {
    pub(super) fn tile(tile: usize, source: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Tile {
            tile,
            source: Box::new(source),
        }
    }

    pub(super) fn labels(tile: usize, source: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Labels {
            tile,
            source: Box::new(source),
        }
    }
}
