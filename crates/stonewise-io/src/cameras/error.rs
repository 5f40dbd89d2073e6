//! What can go wrong with camera files and photo folders.

use crate::image_io::ImageIoError;
use crate::{text, xml};
use roxmltree::Document;
use std::path::{Path, PathBuf};

/// Why cameras or photos could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// The file system refused.
    #[error("{}: cannot read cameras or photos: {source}", path.display())]
    Read {
        /// File or folder.
        path: PathBuf,
        /// Error from the system.
        source: std::io::Error,
    },
    /// The file system refused to write.
    #[error("{}: cannot write cameras: {source}", path.display())]
    Write {
        /// File or folder.
        path: PathBuf,
        /// Error from the system.
        source: std::io::Error,
    },
    /// Not a camera file.
    #[error(
        "{}: not a camera file: give a Metashape cameras.xml, a COLMAP folder (cameras and images, .txt or .bin), an OpenSfM \
         reconstruction.json, Pix4D's calibrated_camera_parameters.txt or project.opf, or RealityCapture's camera parameters \
         (.csv) or a folder of its .xmp files", path.display()
    )]
    UnknownFormat {
        /// File or folder.
        path: PathBuf,
    },
    /// A format that is recognised only to say what to give instead.
    #[error("{}: {instead}", path.display())]
    NotRead {
        /// File.
        path: PathBuf,
        /// Which format it is, and what to give instead.
        instead: &'static str,
    },
    /// A value is missing or impossible.
    #[error("{}: {problem}, at {place}", path.display())]
    Malformed {
        /// File.
        path: PathBuf,
        /// Line, element or photo.
        place: String,
        /// What is wrong there.
        problem: String,
    },
    /// No photo has a pose.
    #[error(
        "{}: no aligned camera in the file ({skipped} without a usable pose): align the photos and export the cameras again", path.display()
    )]
    NoPoses {
        /// File or folder.
        path: PathBuf,
        /// Photos listed without a usable pose.
        skipped: usize,
    },
    /// The lens model is not supported.
    #[error(
        "{}: camera model {model} of photo {photo} is not supported: undistort the photos or calibrate with a frame (Brown) \
         or fisheye model", path.display()
    )]
    UnsupportedModel {
        /// File.
        path: PathBuf,
        /// Model as the file names it.
        model: String,
        /// First photo that uses it.
        photo: String,
    },
    /// Poses that cannot be transformed to the system of the clouds.
    #[error(
        "{}: cameras in {crs} cannot be transformed to the system of the clouds: {reason}; or set the chunk's reference to the clouds' system, or to \
         local coordinates in their frame, and export the cameras again", path.display()
    )]
    UnsupportedCrs {
        /// File.
        path: PathBuf,
        /// Name of the reference system.
        crs: String,
        /// Why, and the fix.
        reason: String,
    },
    /// No photo in the folder.
    #[error("{}: no photo (jpg, jpeg, png, tif) in the folder", folder.display())]
    NoPhotos {
        /// Folder of photos.
        folder: PathBuf,
    },
    /// No photo inside E57 files.
    #[error("{files}: {problem}")]
    NoImages {
        /// Paths of the files.
        files: String,
        /// What there is instead, and the fix.
        problem: String,
    },
    /// A photo cannot be written.
    #[error(transparent)]
    Image(#[from] ImageIoError),
    /// Two photos match one camera equally well.
    #[error("camera {camera} matches two photos, {} and {}: rename or remove one", first.display(), second.display())]
    AmbiguousPhoto {
        /// Name in the camera file.
        camera: String,
        /// One photo.
        first: PathBuf,
        /// The other photo.
        second: PathBuf,
    },
}

/// Reads a text file.
pub(super) fn read_text(path: &Path) -> Result<String, CameraError> {
    text::read_text(path).map_err(|source| CameraError::Read {
        path: path.to_owned(),
        source,
    })
}

/// Parses the text of an XML file.
pub(super) fn parse_xml<'a>(text: &'a str, path: &Path) -> Result<Document<'a>, CameraError> {
    xml::parse(text).map_err(|error| malformed(path, format!("line {}", error.line), error.problem))
}

/// Builds "this file, at this place, has this problem".
pub(super) fn malformed(path: &Path, place: impl Into<String>, problem: impl Into<String>) -> CameraError {
    CameraError::Malformed {
        path: PathBuf::from(path),
        place: place.into(),
        problem: problem.into(),
    }
}
