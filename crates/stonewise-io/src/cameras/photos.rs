//! Which file in a folder is which camera's photo.

use super::{CameraError, CameraFile, extension};
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
/// Upper and lower case are the same; a name in the camera file may lack its extension and may carry folders. A file of
/// exactly that name is preferred to one that only shares the stem, then the one with more of the name's folders, then the one less
/// deep in the folder.
///
/// # Errors
/// The folder cannot be read or holds no photo, or two files fit one view equally well.
pub fn find_photos(folder: &Path, cameras: &CameraFile) -> Result<Photos, CameraError> {
    let mut files = Vec::new();
    collect(folder, &mut files)?;
    if files.is_empty() {
        return Err(CameraError::NoPhotos {
            folder: folder.to_owned(),
        });
    }
    files.sort();
    let names: Vec<FileName> = files
        .iter()
        .map(|path| FileName::new(&path.strip_prefix(folder).unwrap_or(path).to_string_lossy()))
        .collect();
    let mut is_used = vec![false; files.len()];
    let mut paths = Vec::with_capacity(cameras.views.len());
    for view in &cameras.views {
        let wanted = FileName::new(&view.name);
        let scored = names
            .iter()
            .enumerate()
            .filter_map(|(i, name)| Some((wanted.fit(name)?, i)));
        let best = scored.clone().map(|(fit, _)| fit).max();
        let mut fitting = scored.filter(|(fit, _)| Some(*fit) == best).map(|(_, i)| i);
        let (first, second) = (fitting.next(), fitting.next());
        if let (Some(first), Some(second)) = (first, second) {
            return Err(CameraError::AmbiguousPhoto {
                camera: view.name.clone(),
                first: files[first].clone(),
                second: files[second].clone(),
            });
        }
        if let Some(first) = first {
            is_used[first] = true;
        }
        paths.push(first.map(|i| files[i].clone()));
    }
    let without_camera = files
        .into_iter()
        .zip(is_used)
        .filter(|(_, used)| !used)
        .map(|(path, _)| path);
    Ok(Photos {
        paths,
        without_camera: without_camera.collect(),
    })
}

/// A name in lower case, cut into folders and file.
struct FileName {
    folders: Vec<String>,
    file: String,
}

impl FileName {
    fn new(name: &str) -> Self {
        let lower = name.to_lowercase();
        let mut folders: Vec<String> = lower.split(['/', '\\']).map(str::to_owned).collect();
        let file = folders.pop().unwrap_or_default();
        Self { folders, file }
    }

    /// How well a file fits this camera name, larger is better; `None` if not at all.
    fn fit(&self, file: &Self) -> Option<(u8, usize, std::cmp::Reverse<usize>)> {
        let sort = if self.file == file.file {
            2
        } else if self.file == stem(&file.file) {
            1
        } else if stem(&self.file) == stem(&file.file) && is_photo(Path::new(&self.file)) {
            0
        } else {
            return None;
        };
        let pairs = self.folders.iter().rev().zip(file.folders.iter().rev());
        let shared = pairs.take_while(|(a, b)| a == b).count();
        Some((sort, shared, std::cmp::Reverse(file.folders.len())))
    }
}

fn stem(file: &str) -> &str {
    file.rsplit_once('.').map_or(file, |(stem, _)| stem)
}

fn is_photo(path: &Path) -> bool {
    matches!(extension(path).as_str(), "jpg" | "jpeg" | "png" | "tif" | "tiff")
}

/// Photos in a folder and below; hidden files and folders are left out.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), CameraError> {
    let failed = |source| CameraError::Read {
        path: folder.to_owned(),
        source,
    };
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let is_hidden = path
            .file_name()
            .is_some_and(|n| n.to_string_lossy().starts_with('.'));
        if is_hidden {
            continue;
        }
        if path.is_dir() {
            collect(&path, files)?;
        } else if is_photo(&path) {
            files.push(path);
        }
    }
    Ok(())
}
