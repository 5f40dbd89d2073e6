//! COLMAP models: cameras and images as text or binary files.
//!
//! Poses take world to camera; first pixel centre at (0.5, 0.5). The 3D points are not read.

mod binary;
mod model;
mod raw;
mod text;
mod write;

pub use write::write_colmap;

use super::{CameraError, CameraFile, Remark};
use nalgebra::{Quaternion, Translation3};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use stonewise_core::geometry::{Camera, Rigid3, View, rotation_of};
use stonewise_core::id::ImageId;

/// Whether a folder holds a COLMAP model, see [`read_folder`].
pub fn is_camera_folder(folder: &Path) -> bool {
    !models(folder).is_empty()
}

/// Reads the model in a folder itself, else the one with most photos in its `sparse`, in a folder there, or in a numbered
/// folder such as `0`: COLMAP writes a model for each group of photos that it cannot join to the others.
pub fn read_folder(folder: &Path) -> Result<CameraFile, CameraError> {
    let models = models(folder);
    let mut read = Vec::new();
    for (place, extension) in &models {
        read.push(read_model(place, extension)?);
    }
    let largest = (0..read.len()).max_by_key(|&i| (read[i].views.len(), std::cmp::Reverse(i)));
    let Some(largest) = largest else {
        return Err(CameraError::UnknownFormat {
            path: PathBuf::from(folder),
        });
    };
    let mut file = std::mem::take(&mut read[largest]);
    if models.len() > 1 {
        let name = |i: usize| {
            let place = models[i].0.strip_prefix(folder).unwrap_or(&models[i].0);
            place.to_string_lossy().replace('\\', "/")
        };
        let others = (0..read.len()).filter(|&i| i != largest);
        file.warnings.push(Remark::LargestModel {
            read: (name(largest), file.views.len()),
            others: others.clone().map(|i| (name(i), read[i].views.len())).collect(),
        });
        let names: BTreeSet<&str> = file.views.iter().map(|view| view.name.as_str()).collect();
        let elsewhere = others.flat_map(|i| &read[i].views);
        let left = elsewhere.filter(|view| !names.contains(view.name.as_str()));
        let left = left.map(|view| (view.name.clone(), Remark::SmallerReconstruction));
        file.skipped.extend(left);
    }
    Ok(file)
}

/// Folders of models, with the extension of their files, in the order of their names.
fn models(folder: &Path) -> Vec<(PathBuf, &'static str)> {
    let model = |place: PathBuf| {
        let has = |name: &str, extension: &str| place.join(name).with_extension(extension).is_file();
        let extension = ["bin", "txt"]
            .into_iter()
            .find(|e| has("cameras", e) && has("images", e))?;
        Some((place, extension))
    };
    if let Some(own) = model(folder.to_owned()) {
        return vec![own];
    }
    let is_number = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        !name.is_empty() && name.bytes().all(|b| b.is_ascii_digit())
    };
    let sparse = folder.join("sparse");
    let mut places = inner(&sparse);
    places.push(sparse);
    places.extend(inner(folder).into_iter().filter(is_number));
    places.into_iter().filter_map(model).collect()
}

/// What lies in a folder, sorted by the length of the names and then by the names, which sorts numbers.
fn inner(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    paths.sort_by_cached_key(|path| (path.as_os_str().len(), path.clone()));
    paths
}

fn read_model(folder: &Path, extension: &str) -> Result<CameraFile, CameraError> {
    let [cameras, images] = ["cameras", "images"].map(|name| folder.join(name).with_extension(extension));
    let (cameras, images) = (cameras.as_path(), images.as_path());
    let (raw_cameras, raw_images) = match extension {
        "bin" => (binary::read_cameras(cameras)?, binary::read_images(images)?),
        _ => (text::read_cameras(cameras)?, text::read_images(images)?),
    };
    let mut converted: BTreeMap<u32, Camera> = BTreeMap::new();
    let mut file = CameraFile::default();

    for raw in raw_images {
        let bad = |problem: String| super::malformed(images, raw.place.clone(), problem);
        let camera = match converted.entry(raw.camera_id) {
            Entry::Occupied(known) => known.get().clone(),
            Entry::Vacant(new) => {
                let listed = raw_cameras.get(&raw.camera_id).ok_or_else(|| {
                    let (photo, id) = (&raw.name, raw.camera_id);
                    bad(format!(
                        "photo {photo} names camera {id}, which {} does not list",
                        cameras.display()
                    ))
                })?;
                new.insert(model::camera(listed, &raw.name, cameras)?).clone()
            }
        };
        let [w, x, y, z] = raw.rotation_wxyz;
        let turn = rotation_of(Quaternion::new(w, x, y, z));
        let Some(turn) = turn.filter(|_| raw.translation.iter().all(|v| v.is_finite())) else {
            return Err(bad(format!(
                "photo {} has no valid rotation and translation",
                raw.name
            )));
        };
        file.views.push(View {
            image: ImageId(file.views.len() as u32),
            camera,
            cam_from_world: Rigid3::from_parts(Translation3::from(raw.translation), turn),
            name: raw.name,
        });
    }

    Ok(file)
}
