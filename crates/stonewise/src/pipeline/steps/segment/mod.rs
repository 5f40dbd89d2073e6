//! The photos of an epoch that can vote: posed, present, with the outlines of their stones.

mod choose;
mod detector;
mod masks;
mod voting_photo;

use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Need, Phase, Photos, Run, Step};
use crate::pipeline::steps::ingest::INGEST;
use crate::pipeline::steps::views::VIEWS;
use crate::project::{Epoch, Project};
use crate::storage::step::{Key, StepDir, look_of};
use crate::warnings::Warnings;
pub use choose::CHOOSE;
use detector::Detection;
use masks::write_labels;
use std::path::PathBuf;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::View;
use stonewise_core::id::ImageId;
use stonewise_core::raster::LabelImage;
use stonewise_io::masks::read_label_png;
use stonewise_segment::Weights;
pub use voting_photo::VotingPhoto;
use voting_photo::{PHOTOS, STEP, label_path, photo_bytes, posed_photos};

/// Brings the stones of every photo of an epoch into one label image each: from masks, where the epoch has
/// them, else from the detector.
pub static SEGMENT: Step = Step {
    name: STEP,
    phase: Some(Phase::Find),
    about: About::Epoch,
    needs: &[
        Need::same(&VIEWS).when(Project::has_views),
        // A detector that takes relief looks at the clouds, too.
        Need::same(&INGEST).when(takes_relief),
        Need::same(&CHOOSE).when(Project::chooses_photos),
    ],
    cost: Some(|sizes, epoch| Cost::of(2, photo_bytes(sizes, epoch))),
    photos: Some(Photos {
        count: photos_to_segment,
        cost: |sizes, epoch| Cost::of(4, photo_bytes(sizes, epoch)),
        make: |run, epoch, number| Detection::new(run, epoch)?.photo(number),
    }),
    make: |run, epoch| run.segmented(epoch).map(drop),
    ..Step::PLAIN
};

fn takes_relief(project: &Project, epoch: EpochId) -> bool {
    let weights = Weights::named(&project.settings.segment.model);
    // An error is reported where the detector is opened.
    project.epochs[epoch].masks.is_none() && matches!(weights.takes_relief(), Ok(true))
}

impl Run<'_> {
    /// The photos of an epoch with their stones.
    pub fn segmented(&self, epoch: EpochId) -> Result<Arc<Segmented>> {
        self.once(&SEGMENT, epoch, || segment(self, epoch))
    }
}

/// The photos of an epoch after the segment step.
pub struct Segmented {
    /// Where the label images lie, and the key they were made under.
    pub step: StepDir,
    /// Photos, then views of the clouds.
    pub photos: Vec<VotingPhoto>,
    /// Their cameras, in the same order; image ids are indices.
    pub views: Vec<View>,
}

impl Segmented {
    /// Number of photos, which come before views.
    pub fn photo_count(&self) -> usize {
        self.photos.iter().take_while(|photo| !photo.is_view).count()
    }

    /// Number of pictures that results show: of photos, or of views where there are only views.
    pub fn shown_count(&self) -> usize {
        match self.photo_count() {
            0 => self.photos.len(),
            count => count,
        }
    }

    /// The label image of a photo; `None` where no stones were looked for in it.
    pub fn labels(&self, image: ImageId) -> Result<Option<LabelImage>> {
        let number = image.0 as usize;
        let is_labelled = self.photos.get(number).is_some_and(|photo| photo.is_labelled);
        let labels = is_labelled.then(|| read_label_png(&label_path(&self.step, number)));
        Ok(labels.transpose()?)
    }
}

fn segment(run: &Run, id: EpochId) -> Result<Segmented> {
    let context = run.context;
    let epoch = &run.pictured(id)?;
    let step = match (&epoch.masks, &epoch.photos) {
        (None, _) | (_, None) => Detection::new(run, id)?.all()?,
        (Some(masks), Some(files)) => {
            let digests = [
                context.digest(&files.cameras)?,
                context.digest(masks)?,
                // Masks, not photos, decide the labels.
                look_of(&files.images, false)?,
            ];
            let key = Key::new(STEP, &(), &digests.each_ref().map(String::as_str));
            context.step(&format!("{STEP}-{id}"), key, |step, warnings| {
                let photos = write_labels(context, epoch, masks, step, warnings)?;
                write_json(&step.file(PHOTOS), &photos)
            })?
        }
    };
    let photos: Vec<VotingPhoto> = read_json(&step.file(PHOTOS))?;
    let mut cameras = epoch.read_cameras()?.views;
    if let Some(with_views) = run.beside_photos(id)? {
        cameras.extend(with_views.read_cameras()?.views);
    }
    let views = photos.iter().enumerate().filter_map(|(i, photo)| {
        let mut named = cameras.iter().filter(|v| v.name == photo.camera);
        // A photo may have the name of a view; views come last.
        let view = if photo.is_view {
            named.next_back()
        } else {
            named.next()
        }?;
        Some(View {
            image: ImageId(i as u32),
            ..view.clone()
        })
    });
    let views = views.collect();
    Ok(Segmented { step, photos, views })
}

/// Photos of an epoch that the detector has to look at; none where it has masks. How many views of clouds there
/// will be is not known before.
fn photos_to_segment(project: &Project, epoch: EpochId) -> Result<usize> {
    match &project.epochs[epoch].masks {
        None => Ok(photo_files(&project.epochs[epoch])?.len()),
        Some(_) => Ok(0),
    }
}

/// The photos of an epoch that have a camera.
pub fn photo_files(epoch: &Epoch) -> Result<Vec<PathBuf>> {
    let posed = posed_photos(epoch, &Warnings::default())?;
    Ok(posed.into_iter().map(|(_, path)| path).collect())
}
