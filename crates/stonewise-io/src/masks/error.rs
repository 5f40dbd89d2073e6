//! What can go wrong with masks.

use crate::image_io::ImageIoError;
use std::path::{Path, PathBuf};

/// Why masks could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MaskError {
    /// The file system refused.
    #[error("{}: cannot read masks: {source}", path.display())]
    Read {
        /// File or folder.
        path: PathBuf,
        /// Error from the system.
        source: std::io::Error,
    },
    /// The file system refused to write.
    #[error("{}: cannot write masks: {source}", path.display())]
    Write {
        /// File.
        path: PathBuf,
        /// Error from the system.
        source: std::io::Error,
    },
    /// Not COCO json.
    #[error("{}: not a COCO instances file: {problem}", path.display())]
    Json {
        /// File.
        path: PathBuf,
        /// What and where.
        problem: String,
    },
    /// Not a file of valid regions.
    #[error("{}: not a file of valid regions: {problem}", path.display())]
    Regions {
        /// File.
        path: PathBuf,
        /// What and where.
        problem: String,
    },
    /// There are no masks.
    #[error("{}: no masks: {expected}", path.display())]
    Empty {
        /// File or folder.
        path: PathBuf,
        /// What was expected there.
        expected: &'static str,
    },
    /// Several categories, none of which is that of the stones.
    #[error("{}: its annotations have the categories {found}: call that of the stones \"stone\"; others are left out then", path.display())]
    Categories {
        /// File.
        path: PathBuf,
        /// Their names, and how many annotations each has.
        found: String,
    },
    /// An annotation cannot be read.
    #[error("{}: annotation {annotation}: {problem}", path.display())]
    BadAnnotation {
        /// File.
        path: PathBuf,
        /// The annotation's id.
        annotation: String,
        /// What is wrong with it.
        problem: String,
    },
    /// Made for another image size.
    #[error(
        "{}: masks of photo {photo} are {}x{} px, but its camera is {}x{} px: give masks of the original photo", path.display(), found.0, found.1, expected.0, expected.1
    )]
    WrongSize {
        /// Mask file.
        path: PathBuf,
        /// Photo.
        photo: String,
        /// Size of the masks.
        found: (u32, u32),
        /// Size of the photo's camera.
        expected: (u32, u32),
    },
    /// Two entries match one photo.
    #[error("{}: photo {photo} matches both {first} and {second}: rename one, or give each epoch its own masks", path.display())]
    Ambiguous {
        /// File or folder.
        path: PathBuf,
        /// Photo.
        photo: String,
        /// One entry.
        first: String,
        /// The other entry.
        second: String,
    },
    /// A PNG that is not a label image.
    #[error("{}: a label image must be a greyscale PNG of 8 or 16 bits, but this one is {found}", path.display())]
    NotGrey {
        /// File.
        path: PathBuf,
        /// What it is.
        found: String,
    },
    /// More pixels than the file can hold.
    #[error(
        "{}: the header claims {}x{} pixels, but the file has only {length} bytes: write the label image again", path.display(), claimed.0, claimed.1
    )]
    TooManyPixels {
        /// File.
        path: PathBuf,
        /// Width and height that the header claims.
        claimed: (u32, u32),
        /// Bytes of the file.
        length: u64,
    },
    /// A label does not fit the format.
    #[error("{}: label {label} does not fit a 16-bit PNG: write COCO json instead", path.display())]
    LabelTooLarge {
        /// File.
        path: PathBuf,
        /// The label.
        label: u32,
    },
    /// The picture itself is broken or cannot be written.
    #[error(transparent)]
    Image(#[from] ImageIoError),
}

impl MaskError {
    /// Refuses masks of another size than the photo's.
    pub(super) fn check_size(
        path: &Path,
        photo: &str,
        found: (u32, u32),
        expected: (u32, u32),
    ) -> Result<(), Self> {
        match found == expected {
            true => Ok(()),
            false => Err(Self::WrongSize {
                path: path.to_owned(),
                photo: photo.to_owned(),
                found,
                expected,
            }),
        }
    }
}
