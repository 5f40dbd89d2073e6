//! COLMAP models: cameras and images as text or binary files.
//!
//! Poses take world to camera; first pixel centre at (0.5, 0.5). The 3D points are not read.

mod binary;
mod model;
mod raw;
mod text;
mod write;

pub use write::write_colmap;

use super::{CameraError, CameraFile};
use nalgebra::{Quaternion, Translation3};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};
use stonewise_core::geometry::{Camera, Rigid3, View, rotation_of};
use stonewise_core::id::ImageId;

/// Whether a folder holds a COLMAP model, in itself or in its `sparse/0`, `sparse` or `0`.
pub fn is_camera_folder(folder: &Path) -> bool {
    model_files(folder).is_some()
}

/// Reads the model in a folder, or in its `sparse/0`, `sparse` or `0`.
pub fn read_folder(folder: &Path) -> Result<CameraFile, CameraError> {
    match model_files(folder) {
        Some((cameras, images)) => read_pair(&cameras, &images),
        None => Err(CameraError::UnknownFormat {
            path: PathBuf::from(folder),
        }),
    }
}

fn model_files(folder: &Path) -> Option<(PathBuf, PathBuf)> {
    for inner in ["", "sparse/0", "sparse", "0"] {
        for extension in ["bin", "txt"] {
            let base = folder.join(inner);
            let cameras = base.join("cameras").with_extension(extension);
            let images = base.join("images").with_extension(extension);
            if cameras.is_file() && images.is_file() {
                return Some((cameras, images));
            }
        }
    }
    None
}

fn read_pair(cameras: &Path, images: &Path) -> Result<CameraFile, CameraError> {
    let is_binary = cameras.extension().is_some_and(|e| e == "bin");
    let (raw_cameras, raw_images) = if is_binary {
        (binary::read_cameras(cameras)?, binary::read_images(images)?)
    } else {
        (text::read_cameras(cameras)?, text::read_images(images)?)
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
