//! The photos of both halves.

use super::half::half_folder;
use crate::Epoch;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_base::error::{Error, Result};
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
    let Some(files) = &epoch.photos else {
        return Ok(Vec::new());
    };
    let cameras = epoch.read_cameras()?;
    let photos = find_photos(&files.images, &cameras)?;
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

/// Copies the photos of a half into its folder; photos in subfolders of `images` keep their subfolders, so
/// that photos of the same name stay apart.
pub(super) fn copy_photos(
    photos: &[PosedPhoto],
    images: &Path,
    half: usize,
    out: &Path,
    progress: &dyn Progress,
) -> Result<()> {
    let folder = out.join(half_folder(half)).join("images");
    for photo in photos.iter().skip(half).step_by(2) {
        progress.check()?;
        let name = photo.path.strip_prefix(images);
        let copy = folder.join(name.unwrap_or(Path::new(&photo.view)));
        let parent = copy.parent().unwrap_or(&folder);
        fs::create_dir_all(parent).map_err(Error::io("making a folder", parent))?;
        fs::copy(&photo.path, &copy).map_err(Error::io("copying a photo to", &copy))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::progress::Silent;

    #[test]
    fn photos_of_one_name_in_two_folders_are_both_copied() {
        let dir = tempfile::tempdir().unwrap();
        let images = dir.path().join("images");
        let photos: Vec<PosedPhoto> = ["morning/1.jpg", "noon/1.jpg", "evening/1.jpg", "2.jpg"]
            .map(|name| {
                let path = images.join(name);
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                fs::write(&path, name).unwrap();
                PosedPhoto {
                    path,
                    view: name.to_owned(),
                }
            })
            .into();
        for half in 0..2 {
            copy_photos(&photos, &images, half, dir.path(), &Silent).unwrap();
        }
        let copied = |half: usize, name: &str| {
            fs::read_to_string(dir.path().join(half_folder(half)).join("images").join(name)).ok()
        };
        for (i, photo) in photos.iter().enumerate() {
            let kept = copied(i % 2, &photo.view);
            assert_eq!(kept.as_deref(), Some(photo.view.as_str()));
            assert_eq!(copied(1 - i % 2, &photo.view), None);
        }
    }
}
