//! Which file in a folder is which camera's photo.

use super::{CameraError, CameraFile};
use crate::folder::files_below;
use crate::photo_name::{PhotoName, is_photo};
use std::cmp::Reverse;
use std::path::{Path, PathBuf};

/// Photos of a folder, joined to the views of a camera file.
#[derive(Clone, Debug, PartialEq)]
pub struct Photos {
    /// One per view: its photo, where the folder has it.
    pub paths: Vec<Option<PathBuf>>,
    /// Photos that no view names, sorted.
    pub without_camera: Vec<PathBuf>,
}

/// Finds the photo of each view, in the folder and the folders below it.
///
/// Upper and lower case are the same; a name in the camera file may lack its extension and may carry folders.
/// A file of exactly that name is preferred to one that only shares the stem, then the one with more of the
/// name's folders, then the one less deep in the folder.
///
/// # Errors
/// The folder cannot be read or holds no photo, or two files fit one view equally well.
pub fn find_photos(folder: &Path, cameras: &CameraFile) -> Result<Photos, CameraError> {
    let photos = PhotoFolder::open(folder)?;
    let mut is_used = vec![false; photos.files.len()];
    let mut paths = Vec::with_capacity(cameras.views.len());
    for view in &cameras.views {
        let found = photos.find(&view.name)?;
        if let Some(found) = found {
            is_used[found] = true;
        }
        paths.push(found.map(|i| photos.files[i].clone()));
    }
    let without_camera = photos
        .files
        .into_iter()
        .zip(is_used)
        .filter(|(_, used)| !used)
        .map(|(path, _)| path);
    Ok(Photos {
        paths,
        without_camera: without_camera.collect(),
    })
}

/// All photos in a folder and below it.
pub(super) struct PhotoFolder {
    pub folder: PathBuf,
    /// Sorted.
    pub files: Vec<PathBuf>,
    names: Vec<PhotoName>,
}

impl PhotoFolder {
    pub fn open(folder: &Path) -> Result<Self, CameraError> {
        let mut files =
            files_below(folder, &is_photo).map_err(|(path, source)| CameraError::Read { path, source })?;
        if files.is_empty() {
            return Err(CameraError::NoPhotos {
                folder: folder.to_owned(),
            });
        }
        files.sort();
        let names = files
            .iter()
            .map(|path| PhotoName::new(&path.strip_prefix(folder).unwrap_or(path).to_string_lossy()))
            .collect();
        Ok(Self {
            folder: folder.to_owned(),
            files,
            names,
        })
    }

    /// The file that fits a name best.
    pub fn find(&self, name: &str) -> Result<Option<usize>, CameraError> {
        let wanted = PhotoName::new(name);
        let scored = self.names.iter().enumerate().filter_map(|(i, name)| {
            let (sort, shared) = wanted.fit(name)?;
            Some(((sort, shared, Reverse(name.depth())), i))
        });
        let best = scored.clone().map(|(fit, _)| fit).max();
        let mut fitting = scored.filter(|(fit, _)| Some(*fit) == best).map(|(_, i)| i);
        let (first, second) = (fitting.next(), fitting.next());
        if let (Some(first), Some(second)) = (first, second) {
            return Err(CameraError::AmbiguousPhoto {
                camera: name.to_owned(),
                first: self.files[first].clone(),
                second: self.files[second].clone(),
            });
        }
        Ok(first)
    }
}
