//! The photos of an epoch that can vote: posed, present, with masks.

use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::network::find_stones;
use crate::pipeline::step::{Key, StepDir};
use crate::project::Epoch;
use crate::warnings::Warnings;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_core::geometry::View;
use stonewise_core::id::ImageId;
use stonewise_core::raster::LabelImage;
use stonewise_io::cameras::{find_photos, read_cameras};
use stonewise_io::masks::{InstanceInfo, MaskSource, read_label_png, write_label_png};

pub(super) const STEP: &str = "segment";
/// List of the photos that can vote, in the step's folder.
pub(super) const PHOTOS: &str = "photos.json";

/// A photo that can vote.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VotingPhoto {
    /// Name of its camera.
    pub camera: String,
    /// The photo.
    pub path: PathBuf,
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

/// The photos of an epoch after the segment step.
pub struct Segmented {
    /// Where the label images lie, and the key they were made under.
    pub step: StepDir,
    /// Photos in the order of the views.
    pub photos: Vec<VotingPhoto>,
    /// Their cameras; image ids are indices.
    pub views: Vec<View>,
}

impl Segmented {
    /// The label image of a photo.
    pub fn labels(&self, image: ImageId) -> Result<LabelImage> {
        Ok(read_label_png(&label_path(&self.step, image.0 as usize))?)
    }
}

/// Brings the stones of every photo of an epoch into one label image each: from masks, where the epoch has them, else from the network.
pub fn segment(context: &Context, number: usize) -> Result<Segmented> {
    let epoch = &context.project.epochs[number - 1];
    let name = format!("{STEP}-{number}");
    let step = match &epoch.masks {
        None => find_stones(context, epoch, &name)?,
        Some(masks) => {
            let digests = [
                context.digest(&epoch.cameras)?,
                context.digest(masks)?,
                listing(&epoch.images)?,
            ];
            let key = Key::new(STEP, &(), &digests.each_ref().map(String::as_str));
            context.step(&name, key, |step, warnings| {
                let photos = write_labels(context, epoch, masks, step, warnings)?;
                write_json(&step.file(PHOTOS), &photos)
            })?
        }
    };
    let photos: Vec<VotingPhoto> = read_json(&step.file(PHOTOS))?;
    let cameras = read_cameras(&epoch.cameras)?;
    let views = photos.iter().enumerate().filter_map(|(i, photo)| {
        let view = cameras.views.iter().find(|v| v.name == photo.camera)?;
        Some(View {
            image: ImageId(i as u32),
            ..view.clone()
        })
    });
    let views = views.collect();
    Ok(Segmented { step, photos, views })
}

fn write_labels(
    context: &Context,
    epoch: &Epoch,
    masks: &Path,
    step: &StepDir,
    warnings: &Warnings,
) -> Result<Vec<VotingPhoto>> {
    let candidates = posed_photos(epoch, warnings)?;
    let source = MaskSource::open(masks)?;
    context
        .progress
        .begin(&format!("masks of {}", epoch.name), candidates.len() as u64);
    let read = candidates
        .par_iter()
        .map(|(view, path)| {
            context.progress.check()?;
            let size = (view.camera.width, view.camera.height);
            let labelled = source.labels_for(&path.to_string_lossy(), size.0, size.1);
            context.progress.advance(1);
            Ok(match labelled {
                Ok(Some(labelled)) => Some(labelled),
                Ok(None) => {
                    warnings.skipped(
                        STEP,
                        path.to_string_lossy(),
                        format!("no masks for this photo in {}", masks.display()),
                    );
                    None
                }
                Err(error) => {
                    warnings.skipped(STEP, path.to_string_lossy(), error.to_string());
                    None
                }
            })
        })
        .collect::<Result<Vec<_>>>()?;
    let mut photos = Vec::new();
    for ((view, path), labelled) in candidates.into_iter().zip(read) {
        let Some(labelled) = labelled else { continue };
        write_label_png(&label_path(step, photos.len()), &labelled.labels)?;
        let instances = labelled.instances.into_iter().map(Instance::from).collect();
        photos.push(VotingPhoto {
            camera: view.name,
            path,
            instances,
        });
    }
    check_any(&photos, epoch, warnings)?;
    Ok(photos)
}

/// An epoch of which no photo can be used cannot be measured.
pub(super) fn check_any(photos: &[VotingPhoto], epoch: &Epoch, warnings: &Warnings) -> Result<()> {
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
pub(super) fn posed_photos(epoch: &Epoch, warnings: &Warnings) -> Result<Vec<(View, PathBuf)>> {
    let cameras = read_cameras(&epoch.cameras)?;
    let file = epoch.cameras.to_string_lossy();
    cameras
        .warnings
        .iter()
        .for_each(|w| warnings.notice(STEP, file.clone(), w.clone()));
    let photos = find_photos(&epoch.images, &cameras)?;
    for path in &photos.without_camera {
        let reason = reason_without_camera(path, &cameras.skipped);
        warnings.skipped(
            STEP,
            path.to_string_lossy(),
            format!("{reason} in {file}; the photo is left out"),
        );
    }
    for (name, reason) in &cameras.skipped {
        warnings.notice(STEP, name.clone(), format!("camera not used: {reason}"));
    }
    let mut posed = Vec::new();
    for (view, path) in cameras.views.into_iter().zip(photos.paths) {
        match path {
            Some(path) => posed.push((view, path)),
            None => warnings.notice(
                STEP,
                view.name,
                format!("camera not used: no such photo in {}", epoch.images.display()),
            ),
        }
    }
    Ok(posed)
}

fn reason_without_camera(photo: &Path, skipped: &[(String, String)]) -> String {
    let stem = |name: &str| Path::new(name).file_stem().map(|s| s.to_ascii_lowercase());
    let reason = skipped
        .iter()
        .find(|(name, _)| stem(name) == stem(&photo.to_string_lossy()));
    reason.map_or("no camera".to_owned(), |(_, reason)| {
        format!("its camera cannot be used ({reason})")
    })
}

pub(super) fn label_path(step: &StepDir, image: usize) -> PathBuf {
    step.file(format!("{image:05}.png"))
}

/// Digest of the names and sizes of a folder's files: masks, not photos, decide the labels.
fn listing(folder: &Path) -> Result<String> {
    let mut entries = fs::read_dir(folder)
        .and_then(|all| {
            all.map(|e| e.and_then(|e| Ok((e.path(), e.metadata()?.len()))))
                .collect::<std::io::Result<Vec<_>>>()
        })
        .map_err(Error::io("listing", folder))?;
    entries.sort();
    Ok(Key::new("listing", &entries, &[]).as_str().to_owned())
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
