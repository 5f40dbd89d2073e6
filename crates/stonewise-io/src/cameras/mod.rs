//! Posed photos from other programs: Agisoft Metashape, COLMAP, OpenSfM.
//!
//! Whatever the file says is turned into [`View`]s: world frame of the file, first pixel centre at (0.5, 0.5), poses that
//! take world to camera. Views keep the order of the file, and a view's image id is its index.

mod colmap;
mod error;
mod metashape;
mod opensfm;
mod photos;
mod xml;

pub use colmap::write_colmap;
pub use error::CameraError;
pub use metashape::write_metashape;
pub use photos::{Photos, find_photos};

use std::path::{Path, PathBuf};
use stonewise_core::geometry::View;

/// What a camera file holds.
#[derive(Clone, Debug, Default)]
pub struct CameraFile {
    /// Posed photos, in the file's order.
    pub views: Vec<View>,
    /// Photos that cannot be used, with the reason: not aligned, disabled.
    pub skipped: Vec<(String, String)>,
    /// Coordinate reference system of the world frame as the file writes it, where it says.
    pub crs: Option<String>,
    /// What a person should know about how the file was read.
    pub warnings: Vec<String>,
}

/// Reads a camera file of any of the known formats.
///
/// - Metashape: the XML of File > Export > Export Cameras.
/// - COLMAP: a folder with cameras and images as .bin or .txt (.bin wins, as in COLMAP), or one of these files, or a folder
///   that holds them under `sparse/0`, `sparse` or `0`.
/// - OpenSfM: reconstruction.json.
///
/// # Errors
/// The file cannot be read or is none of these, a value is missing or impossible, a lens model or reference system is not
/// supported, or no photo has a pose.
pub fn read_cameras(path: &Path) -> Result<CameraFile, CameraError> {
    let file = if path.is_dir() {
        colmap::read_folder(path)?
    } else {
        match extension(path).as_str() {
            "xml" => metashape::read(path)?,
            "json" => opensfm::read(path)?,
            "txt" | "bin" => colmap::read_folder(path.parent().unwrap_or(Path::new(".")))?,
            _ => {
                return Err(CameraError::UnknownFormat {
                    path: path.to_owned(),
                });
            }
        }
    };
    if file.views.is_empty() {
        return Err(CameraError::NoPoses {
            path: path.to_owned(),
            skipped: file.skipped.len(),
        });
    }
    Ok(file)
}

fn extension(path: &Path) -> String {
    path.extension()
        .map(|e| e.to_string_lossy().to_lowercase())
        .unwrap_or_default()
}

fn read_text(path: &Path) -> Result<String, CameraError> {
    std::fs::read_to_string(path).map_err(|source| CameraError::Read {
        path: path.to_owned(),
        source,
    })
}

/// Builds "this file, at this place, has this problem".
fn malformed(path: &Path, place: impl Into<String>, problem: impl Into<String>) -> CameraError {
    CameraError::Malformed {
        path: PathBuf::from(path),
        place: place.into(),
        problem: problem.into(),
    }
}
