//! Photos without masks: their stones, as the detector finds them.

use super::voting_photo::{
    Instance, PHOTOS, STEP, VotingPhoto, check_any, label_name, other_size, posed_photos, unusable,
};
use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::graph::Run;
use crate::pipeline::steps::ingest::Ingested;
use crate::pipeline::steps::views::{drop_empty, has_no_photos};
use crate::project::Epoch;
use crate::storage::step::{Key, StepDir};
use crate::texts::Said;
use crate::warnings::Warnings;
use serde::{Deserialize, Serialize};
use std::cell::OnceCell;
use std::path::PathBuf;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::View;
use stonewise_core::transfer::photo_relief;
use stonewise_io::image_io::read_rgb;
use stonewise_io::masks::write_label_png;
use stonewise_segment::tiling::segment_photo;
use stonewise_segment::{Segmentation, StoneFinder, Weights};

/// What became of a photo, in the folder of its part of the step.
const PHOTO: &str = "photo.json";
/// Its label image.
const LABELS: &str = "labels.png";

/// The step of one epoch: every posed photo and view is a part of it.
pub struct Detection<'a> {
    context: &'a Context<'a>,
    /// With photos, or with views in their place.
    epoch: Epoch,
    is_of_views: bool,
    /// With views in place of its photos, where the detector looks at both.
    with_views: Option<Epoch>,
    /// The scale of each photo; `None`: all as they are.
    chosen: Option<Arc<Vec<Option<f64>>>>,
    name: String,
    key: Key,
    weights: Weights,
    /// The clouds, where the detector takes relief beside colour.
    ingested: Option<Arc<Ingested>>,
    /// Opened for the first photo that needs it.
    detector: OnceCell<StoneFinder>,
}

/// A photo or a view in which stones are looked for.
struct Candidate {
    view: View,
    path: PathBuf,
    is_view: bool,
    /// Scale at which it is looked at first; `None` where it is not.
    scale: Option<f64>,
}

/// What became of a photo.
#[derive(Serialize, Deserialize)]
struct Outcome {
    /// Its stones; absent where it is left out.
    instances: Option<Vec<Instance>>,
    /// Why it is left out.
    reason: Option<Said>,
}

impl<'a> Detection<'a> {
    /// The step of an epoch.
    pub fn new(run: &Run<'a>, id: EpochId) -> Result<Self> {
        let context = run.context;
        let epoch = run.pictured(id)?;
        let params = &context.project.settings.segment;
        let weights = Weights::named(&params.model);
        let digest = context.weights_digest(&weights)?;
        let ingested = match weights.takes_relief() {
            Ok(true) => Some(run.ingested(id)?),
            // An error is reported where the detector is opened.
            Ok(false) | Err(_) => None,
        };
        let mut digests = vec![digest];
        let with_views = run.beside_photos(id)?;
        for files in [Some(&epoch), with_views.as_ref()]
            .into_iter()
            .flatten()
            .flat_map(|e| &e.photos)
        {
            digests.extend([context.digest(&files.cameras)?, context.digest(&files.images)?]);
        }
        let chosen = context
            .project
            .chooses_photos(id)
            .then(|| run.chosen(id))
            .transpose()?;
        digests.extend(ingested.as_ref().map(|i| i.step.key().as_str().to_owned()));
        let digests: Vec<&str> = digests.iter().map(String::as_str).collect();

        Ok(Self {
            context,
            epoch,
            is_of_views: has_no_photos(context.project, id),
            with_views,
            name: format!("{STEP}-{id}"),
            key: Key::new(STEP, &(&params.tiling, chosen.as_deref()), &digests),
            chosen,
            weights,
            ingested,
            detector: OnceCell::new(),
        })
    }

    /// Finds the stones of every posed photo and view; those that are done already are taken over.
    pub fn all(&self) -> Result<StepDir> {
        let done = self
            .context
            .step(&self.name, self.key.clone(), |step, warnings| {
                let photos = self.gather(step, warnings)?;
                write_json(&step.file(PHOTOS), &photos)
            })?;
        self.context.store.remove_parts(&self.name, &self.key)?;
        Ok(done)
    }

    /// Finds the stones of one posed photo, counted from 0.
    pub fn photo(&self, number: usize) -> Result<()> {
        let candidates = self.candidates(&Warnings::default())?;
        let Some(candidate) = candidates.get(number) else {
            return Err(Error::Survey(format!(
                "epoch {:?} has {} posed photos",
                self.epoch.name,
                candidates.len()
            )));
        };
        let Some(scale) = candidate.scale else {
            return Ok(());
        };
        self.context.progress.begin("tiles", self.tiles(candidate));
        self.part(number, candidate, scale).map(|_| ())
    }

    /// Posed photos, then views.
    fn candidates(&self, warnings: &Warnings) -> Result<Vec<Candidate>> {
        let photos = posed_photos(&self.epoch, warnings)?;
        let views = match &self.with_views {
            Some(epoch) => posed_photos(epoch, warnings)?,
            None => Vec::new(),
        };
        let photo = |(number, (view, path)): (usize, (View, PathBuf))| Candidate {
            view,
            path,
            is_view: self.is_of_views,
            scale: match &self.chosen {
                Some(scales) => scales.get(number).copied().flatten(),
                None => Some(1.0),
            },
        };
        let of_clouds = |(view, path): (View, PathBuf)| Candidate {
            view,
            path,
            is_view: true,
            scale: Some(1.0),
        };
        let photos = photos.into_iter().enumerate().map(photo);
        Ok(photos.chain(views.into_iter().map(of_clouds)).collect())
    }

    fn tiles(&self, candidate: &Candidate) -> u64 {
        let tiling = &self.context.project.settings.segment.tiling;
        let camera = &candidate.view.camera;
        candidate
            .scale
            .map_or(0, |scale| tiling.tile_count(camera.width, camera.height, scale))
    }

    fn gather(&self, step: &StepDir, warnings: &Warnings) -> Result<Vec<VotingPhoto>> {
        let candidates = self.candidates(warnings)?;
        let total = candidates.iter().map(|c| self.tiles(c)).sum();
        self.context.progress.begin("tiles", total);
        let mut photos: Vec<VotingPhoto> = Vec::new();
        let count = candidates.len();
        for (number, candidate) in candidates.into_iter().enumerate() {
            self.context
                .progress
                .detail(&format!("picture {} of {count}", number + 1));
            let (outcome, part) = match candidate.scale {
                Some(scale) => {
                    let part = self.part(number, &candidate, scale)?;
                    (read_json(&part.file(PHOTO))?, Some(part))
                }
                None => (Outcome::not_sought(&candidate), None),
            };
            let Candidate {
                view,
                path,
                is_view,
                scale,
            } = candidate;
            if let Some(reason) = outcome.reason {
                warnings.skipped(STEP, path.to_string_lossy(), reason);
            }
            let Some(instances) = outcome.instances else {
                continue;
            };
            if let Some(part) = &part {
                step.take(part, LABELS, &label_name(photos.len()))?;
            }
            photos.push(VotingPhoto {
                camera: view.name,
                path,
                is_view,
                is_labelled: part.is_some(),
                scale,
                instances,
            });
        }
        check_any(&photos, &self.epoch, warnings)?;
        Ok(photos)
    }

    fn part(&self, number: usize, candidate: &Candidate, scale: f64) -> Result<StepDir> {
        let mut is_made = false;
        self.context.progress.check()?;
        let whole = (self.name.as_str(), &self.key);
        let part = self.context.store.part(whole, &format!("{number:05}"), |part| {
            is_made = true;
            let outcome = self.find(part, candidate, scale)?;
            write_json(&part.file(PHOTO), &outcome)
        })?;
        if !is_made {
            self.context.progress.advance(self.tiles(candidate));
        }
        Ok(part)
    }

    fn find(&self, part: &StepDir, candidate: &Candidate, scale: f64) -> Result<Outcome> {
        let progress = self.context.progress;
        let Candidate {
            view, path, is_view, ..
        } = candidate;
        let image = match read_rgb(path) {
            Ok(image) => image,
            Err(error) => {
                progress.advance(self.tiles(candidate));
                return Ok(Outcome::left_out(error.to_string()));
            }
        };
        if let Some(reason) = other_size(view, [image.width(), image.height()]) {
            progress.advance(self.tiles(candidate));
            return Ok(Outcome::left_out(reason));
        }

        let tiling = &self.context.project.settings.segment.tiling;
        let relief = match &self.ingested {
            Some(ingested) => {
                let params = &self.context.project.settings.label;
                Some(photo_relief(&ingested.tiles.surveyed, view, params, progress)?)
            }
            None => None,
        };
        let mut stones = segment_photo(self.detector()?, &image, scale, relief.as_ref(), tiling, progress)?;
        if *is_view {
            drop_empty(&mut stones, &image);
        }
        write_label_png(&part.file(LABELS), &stones.labels)?;

        Ok(Outcome {
            instances: Some(instances(&stones)),
            reason: None,
        })
    }

    fn detector(&self) -> Result<&StoneFinder> {
        if let Some(detector) = self.detector.get() {
            return Ok(detector);
        }
        let least_score = self.context.project.settings.segment.tiling.min_score as f32;
        let opened = StoneFinder::open(&self.weights, least_score)?;
        Ok(self.detector.get_or_init(|| opened))
    }
}

impl Outcome {
    /// That of a photo in which no stones are looked for.
    fn not_sought(photo: &Candidate) -> Self {
        match unusable(&photo.view, &photo.path) {
            Some(reason) => Self::left_out(reason),
            None => Self {
                instances: Some(Vec::new()),
                reason: None,
            },
        }
    }

    fn left_out(reason: impl Into<Said>) -> Self {
        Self {
            instances: None,
            reason: Some(reason.into()),
        }
    }
}

fn instances(stones: &Segmentation) -> Vec<Instance> {
    let instance = |(&id, &score): (&u32, &f32)| Instance {
        id,
        score: f64::from(score),
        stone_ref: None,
    };
    stones.scores.iter().map(instance).collect()
}
