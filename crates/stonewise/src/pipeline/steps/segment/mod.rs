//! The photos of an epoch that can vote: posed, present, with the outlines of their stones.

mod detector;
mod masks;
mod voting_photo;

use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::project::Epoch;
use crate::storage::step::{Key, StepDir};
use crate::warnings::Warnings;
use detector::Detection;
pub use detector::part_name;
use masks::write_labels;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_core::geometry::View;
use stonewise_core::id::ImageId;
use stonewise_core::raster::LabelImage;
use stonewise_io::masks::read_label_png;
use voting_photo::{PHOTOS, STEP, VotingPhoto, label_path, posed_photos};

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

/// Brings the stones of every photo of an epoch into one label image each: from masks, where the epoch has
/// them, else from the detector.
pub fn segment(context: &Context, number: usize) -> Result<Segmented> {
    let epoch = &context.project.epochs[number - 1];
    let name = format!("{STEP}-{number}");
    let step = match &epoch.masks {
        None => Detection::new(context, number)?.all()?,
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
    let cameras = epoch.read_cameras()?;
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

/// Finds the stones of one posed photo, counted from 0, of an epoch without masks: a part of [`segment`].
pub fn segment_photo(context: &Context, number: usize, photo: usize) -> Result<()> {
    Detection::new(context, number)?.photo(photo)
}

/// Photos of an epoch that the detector has to look at; none where it has masks.
pub fn photos_to_segment(epoch: &Epoch) -> Result<usize> {
    match &epoch.masks {
        None => Ok(posed_photos(epoch, &Warnings::default())?.len()),
        Some(_) => Ok(0),
    }
}

/// The photos of an epoch that have a camera.
pub fn photo_files(epoch: &Epoch) -> Result<Vec<PathBuf>> {
    let posed = posed_photos(epoch, &Warnings::default())?;
    Ok(posed.into_iter().map(|(_, path)| path).collect())
}

/// Digest of the names and sizes of a folder's files: masks, not photos, decide the labels.
pub(in crate::pipeline) fn listing(folder: &Path) -> Result<String> {
    let mut entries = fs::read_dir(folder)
        .and_then(|all| {
            all.map(|e| e.and_then(|e| Ok((e.path(), e.metadata()?.len()))))
                .collect::<std::io::Result<Vec<_>>>()
        })
        .map_err(Error::io("listing", folder))?;
    entries.sort();
    Ok(Key::new("listing", &entries, &[]).as_str().to_owned())
}
