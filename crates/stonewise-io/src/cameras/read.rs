//! Camera files of any of the known formats.

use super::camera_file::MAX_PIXELS;
use super::photo_sizes::PhotoSizes;
use super::{
    CameraError, CameraFile, MapFrame, colmap, malformed, metashape, opensfm, opf, pix4d, realitycapture,
    unread_cameras,
};
use crate::folder::extension;
use std::path::Path;
use stonewise_core::geometry::View;

/// Reads a camera file of any of the known formats.
///
/// - Metashape: the XML of File > Export > Export Cameras.
/// - COLMAP: a folder with cameras and images as .bin or .txt (.bin wins, as in COLMAP), or one of these
///   files, or a folder that holds one or more models under `sparse/0`, `sparse` or `0`, of which the largest is read.
/// - OpenSfM: reconstruction.json.
/// - Pix4D: PROJECT_calibrated_camera_parameters.txt, with PROJECT_offset.xyz beside it.
/// - Pix4D and others: the project.opf of the Open Photogrammetry Format, with the files that it names beside it.
/// - RealityCapture: the CSV of internal and external camera parameters, or a folder with XMP sidecars.
///
/// The last does not tell the sizes of the photos, which must lie in the file's folder or below it.
///
/// ```
/// use stonewise_io::cameras::read_cameras;
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path();
/// std::fs::write(path.join("cameras.txt"), "1 SIMPLE_PINHOLE 4000 3000 3200 2000 1500\n")?;
/// std::fs::write(path.join("images.txt"), "1 1 0 0 0 0 0 5 1 wall.jpg\n\n")?;
/// let file = read_cameras(path)?;
/// // World to camera is a shift by 5 m along the viewing direction: the camera lies 5 m behind the origin.
/// assert_eq!((file.views[0].name.as_str(), file.views[0].centre().z), ("wall.jpg", -5.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The file cannot be read or is none of these, a value is missing or impossible, a lens model or reference
/// system is not supported, or no photo has a pose.
pub fn read_cameras(path: &Path) -> Result<CameraFile, CameraError> {
    read_cameras_on_map(path, None, &MapFrame::default())
}

/// Reads cameras as [`read_cameras`] does, for clouds whose place on the map is known, and with the folder of the
/// photos where it is another than that of the camera file.
///
/// Metashape stores the poses of georeferenced chunks earth-centred. They are brought to the system of the
/// clouds; without one, to the chunk's own if it is a projected one. Transverse Mercator grids and Lambert's
/// cone are covered, and no shift between geodetic datums. The other formats are read as they are.
///
/// # Errors
/// As [`read_cameras`].
pub fn read_cameras_on_map(
    path: &Path,
    photos: Option<&Path>,
    map: &MapFrame,
) -> Result<CameraFile, CameraError> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    if let Some(instead) = unread_cameras(path) {
        return Err(CameraError::NotRead {
            path: path.to_owned(),
            instead,
        });
    }
    let file = if path.is_dir() {
        match colmap::is_camera_folder(path) {
            false if realitycapture::is_sidecar_folder(path) => realitycapture::read_sidecars(path, photos)?,
            _ => colmap::read_folder(path)?,
        }
    } else {
        match extension(path).as_str() {
            "xml" => metashape::read(path, map)?,
            "json" => opensfm::read(path)?,
            "opf" => opf::read(path)?,
            "txt" if pix4d::is_pix4d(path) => pix4d::read(path)?,
            "txt" | "bin" => colmap::read_folder(folder)?,
            "csv" if realitycapture::is_csv(path) => {
                let photos = PhotoSizes::below(photos.unwrap_or(folder), path)?;
                realitycapture::read_csv(path, &photos)?
            }
            "xmp" => realitycapture::read_sidecars(folder, photos)?,
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

    check_sizes(&file, path)?;
    check_places(&file, path)?;
    Ok(file)
}

/// Whether a file is a camera file, by its name, or by its first lines where clouds have such names too.
pub fn is_camera_file(path: &Path) -> bool {
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    match extension(path).as_str() {
        "xml" | "opf" => true,
        "csv" => realitycapture::is_csv(path),
        "json" => name.contains("reconstruction"),
        _ => pix4d::is_pix4d(path),
    }
}

/// Refuses photos that no memory holds.
fn check_sizes(file: &CameraFile, path: &Path) -> Result<(), CameraError> {
    let pixels = |view: &&View| u64::from(view.camera.width) * u64::from(view.camera.height);
    let Some(view) = file.views.iter().find(|view| pixels(view) > MAX_PIXELS) else {
        return Ok(());
    };
    let problem = format!(
        "its camera has {}x{} pixels, more than any photo",
        view.camera.width, view.camera.height
    );
    Err(malformed(path, format!("photo {}", view.name), problem))
}

/// Refuses cameras whose place is beyond all numbers.
fn check_places(file: &CameraFile, path: &Path) -> Result<(), CameraError> {
    let is_lost = |view: &&View| !view.centre().iter().all(|c| c.is_finite());
    let Some(view) = file.views.iter().find(is_lost) else {
        return Ok(());
    };
    let place = format!("photo {}", view.name);
    Err(malformed(
        path,
        place,
        "its rotation and translation give no place",
    ))
}
