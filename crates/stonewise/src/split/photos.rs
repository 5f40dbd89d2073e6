//! The photos of both halves.

use super::half::half_folder;
use crate::error::{Error, Result};
use crate::project::Epoch;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_core::progress::Progress;
use stonewise_core::statistics::split_mix;
use stonewise_io::cameras::find_photos;

/// A photo with a pose.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PosedPhoto {
    /// Where it is.
    pub path: PathBuf,
    /// Its name in the camera file.
    pub view: String,
}

/// Posed photos of the epoch in an order that the seed decides; they go to the halves in turn.
pub(super) fn shuffled_photos(epoch: &Epoch, seed: u64) -> Result<Vec<PosedPhoto>> {
    let cameras = epoch.read_cameras()?;
    let photos = find_photos(&epoch.images, &cameras)?;
    let mut posed: Vec<PosedPhoto> = photos
        .paths
        .into_iter()
        .zip(cameras.views)
        .filter_map(|(path, view)| {
            Some(PosedPhoto {
                path: path?,
                view: view.name,
            })
        })
        .collect();
    posed.sort();
    let mut keyed: Vec<(u64, PosedPhoto)> = posed
        .into_iter()
        .enumerate()
        .map(|(i, photo)| (split_mix(i as u64 ^ split_mix(!seed)), photo))
        .collect();
    keyed.sort();
    Ok(keyed.into_iter().map(|(_, photo)| photo).collect())
}

/// Copies the photos of a half into its folder.
pub(super) fn copy_photos(
    photos: &[PosedPhoto],
    half: usize,
    out: &Path,
    progress: &dyn Progress,
) -> Result<()> {
    let images = out.join(half_folder(half)).join("images");
    fs::create_dir_all(&images).map_err(Error::io("making a folder", &images))?;
    for photo in photos.iter().skip(half).step_by(2) {
        progress.check()?;
        let copy = images.join(photo.path.file_name().unwrap_or_default());
        fs::copy(&photo.path, &copy).map_err(Error::io("copying a photo to", &copy))?;
    }
    Ok(())
}
