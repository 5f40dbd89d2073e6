//! A photo that can vote, and how photos and cameras find each other.

use crate::error::{Error, Result};
use crate::pipeline::cost::Sizes;
use crate::project::Epoch;
use crate::storage::step::StepDir;
use crate::texts::Said;
use crate::texts::notices::{CAMERA_NOT_USED, NO_CAMERA, NO_SUCH_PHOTO, PHOTO_SIZE, UNUSABLE_CAMERA};
use crate::warnings::Warnings;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::View;
use stonewise_io::cameras::{Remark, find_photos};
use stonewise_io::image_io::image_size;
use stonewise_io::masks::InstanceInfo;

/// Name of the step.
pub const STEP: &str = "segment";
/// List of the photos that can vote, in the step's folder.
pub const PHOTOS: &str = "photos.json";

/// Memory of the detector for each pixel of a photo, bytes: the photo as numbers at two sizes, and a tile a
/// thread.
const PIXEL_BYTES: u64 = 100;

/// Memory of the detector for the photos of an epoch, bytes.
pub(super) fn photo_bytes(sizes: &Sizes, epoch: EpochId) -> u64 {
    PIXEL_BYTES * sizes.pixels[epoch]
}

/// A photo that can vote.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VotingPhoto {
    /// Name of its camera.
    pub camera: String,
    /// The photo.
    pub path: PathBuf,
    /// Whether it is a view of the clouds.
    pub is_view: bool,
    /// Whether stones were looked for in it, or drawn: whether it has a label image.
    pub is_labelled: bool,
    /// Scale at which the detector looked at it first, 1 = as it is; absent where it did not.
    pub scale: Option<f64>,
    /// Its instances, as the masks name them.
    pub instances: Vec<Instance>,
}

/// One segmented instance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Instance {
    /// Value in the label image.
    pub id: u32,
    /// Score of the segmentation, 0..1.
    pub score: f64,
    /// Reference stone that the masks themselves name; for evaluation only.
    pub stone_ref: Option<u64>,
}

impl From<InstanceInfo> for Instance {
    fn from(info: InstanceInfo) -> Self {
        Self {
            id: info.id,
            score: info.score,
            stone_ref: info.stone_ref,
        }
    }
}

/// Why a photo cannot be used, as far as its header says so.
pub fn unusable(view: &View, path: &Path) -> Option<Said> {
    match image_size(path) {
        Ok((width, height)) => other_size(view, [width, height]),
        Err(error) => Some(error.to_string().into()),
    }
}

/// What is wrong with the size of a photo, pixels, if its camera states another.
pub fn other_size(view: &View, found: [u32; 2]) -> Option<Said> {
    let expected = [view.camera.width, view.camera.height];
    let [[width, height], [camera_width, camera_height]] =
        [found, expected].map(|size| size.map(|px| px.to_string().into()));
    (found != expected).then(|| {
        PHOTO_SIZE.say(&[
            ("width", width),
            ("height", height),
            ("camera_width", camera_width),
            ("camera_height", camera_height),
        ])
    })
}

/// An epoch of which no photo can be used cannot be measured.
pub fn check_any(photos: &[VotingPhoto], epoch: &Epoch, warnings: &Warnings) -> Result<()> {
    if !photos.is_empty() {
        return Ok(());
    }
    let reasons: Vec<String> = warnings
        .sorted()
        .iter()
        .map(|w| format!("{}: {}", w.subject, w.message))
        .collect();
    Err(Error::Survey(format!(
        "no photo of epoch {:?} can be used:\n  {}",
        epoch.name,
        reasons.join("\n  ")
    )))
}

/// Views with their photos; whatever cannot be used is named.
pub fn posed_photos(epoch: &Epoch, warnings: &Warnings) -> Result<Vec<(View, PathBuf)>> {
    let Some(files) = &epoch.photos else {
        return Ok(Vec::new());
    };
    let cameras = epoch.read_cameras()?;
    let file = files.cameras.to_string_lossy();
    cameras
        .warnings
        .iter()
        .for_each(|w| warnings.notice(STEP, file.clone(), w));
    let photos = find_photos(&files.images, &cameras)?;
    for path in &photos.without_camera {
        let message = without_camera(path, &cameras.skipped, &file);
        warnings.skipped(STEP, path.to_string_lossy(), message);
    }
    for (name, reason) in &cameras.skipped {
        warnings.notice(
            STEP,
            name.clone(),
            CAMERA_NOT_USED.say(&[("reason", reason.into())]),
        );
    }
    let (mut posed, mut missing) = (Vec::new(), Vec::new());
    for (view, path) in cameras.views.into_iter().zip(photos.paths) {
        match path {
            Some(path) => posed.push((view, path)),
            None => missing.push(view.name),
        }
    }
    // A camera file for several epochs names the photos of all of them, so those missing here share one note.
    if let Some(first) = missing.first() {
        let words = [
            ("n", missing.len().to_string().into()),
            ("folder", (&*files.images.to_string_lossy()).into()),
            ("name", first.as_str().into()),
        ];
        warnings.notice(STEP, file, NO_SUCH_PHOTO.say(&words));
    }
    Ok(posed)
}

fn without_camera(photo: &Path, skipped: &[(String, Remark)], file: &str) -> Said {
    let stem = |name: &str| Path::new(name).file_stem().map(|s| s.to_ascii_lowercase());
    let reason = skipped
        .iter()
        .find(|(name, _)| stem(name) == stem(&photo.to_string_lossy()));
    match reason {
        Some((_, reason)) => UNUSABLE_CAMERA.say(&[("file", file.into()), ("reason", reason.into())]),
        None => NO_CAMERA.say(&[("file", file.into())]),
    }
}

/// Where the label image of a photo lies in the step's folder.
pub fn label_path(step: &StepDir, image: usize) -> PathBuf {
    step.file(label_name(image))
}

/// The name of that file.
pub fn label_name(image: usize) -> String {
    format!("{image:05}.png")
}
