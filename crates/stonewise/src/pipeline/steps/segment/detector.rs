//! Photos without masks: their stones, as the detector finds them.

use super::voting_photo::{Instance, PHOTOS, STEP, VotingPhoto, check_any, label_name, posed_photos};
use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::graph::Run;
use crate::pipeline::part::Part;
use crate::pipeline::steps::ingest::Ingested;
use crate::pipeline::steps::views::has_no_photos;
use crate::project::Epoch;
use crate::storage::step::{Key, StepDir};
use crate::texts::Said;
use crate::texts::notices::PHOTO_SIZE;
use crate::warnings::Warnings;
use serde::{Deserialize, Serialize};
use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::View;
use stonewise_core::raster::RgbImage;
use stonewise_core::transfer::photo_relief;
use stonewise_io::image_io::read_rgb;
use stonewise_io::masks::write_label_png;
use stonewise_segment::tiling::segment_photo;
use stonewise_segment::{Segmentation, StoneFinder, Weights};

/// What became of a photo, in the folder of its part of the step.
const PHOTO: &str = "photo.json";
/// Its label image.
const LABELS: &str = "labels.png";

/// The step of one epoch: every posed photo is a part of it.
pub struct Detection<'a> {
    context: &'a Context<'a>,
    /// With photos, or with views in their place.
    epoch: Arc<Epoch>,
    is_of_views: bool,
    name: String,
    key: Key,
    weights: Weights,
    /// The clouds, where the detector takes relief beside colour.
    ingested: Option<Arc<Ingested>>,
    /// Opened for the first photo that needs it.
    detector: OnceCell<StoneFinder>,
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
        let digest = match &weights {
            Weights::BuiltIn => blake3::hash(
                &weights
                    .bytes()
                    .map_err(|error| no_masks(context, &epoch, &error))?,
            )
            .to_hex()
            .to_string(),
            Weights::File(path) => context.digest(path)?,
        };

        let ingested = match weights.takes_relief() {
            Ok(true) => Some(run.ingested(id)?),
            // An error is reported where the detector is opened.
            Ok(false) | Err(_) => None,
        };
        let mut digests = vec![digest];
        if let Some(files) = &epoch.photos {
            digests.extend([context.digest(&files.cameras)?, context.digest(&files.images)?]);
        }
        digests.extend(ingested.as_ref().map(|i| i.step.key().as_str().to_owned()));
        let digests: Vec<&str> = digests.iter().map(String::as_str).collect();

        Ok(Self {
            context,
            epoch,
            is_of_views: has_no_photos(context.project, id),
            name: format!("{STEP}-{id}"),
            key: Key::new(STEP, &params.tiling, &digests),
            weights,
            ingested,
            detector: OnceCell::new(),
        })
    }

    /// Finds the stones of every posed photo; photos that are done already are taken over.
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
        let candidates = posed_photos(&self.epoch, &Warnings::default())?;
        let Some((view, path)) = candidates.get(number) else {
            return Err(Error::Survey(format!(
                "epoch {:?} has {} posed photos",
                self.epoch.name,
                candidates.len()
            )));
        };
        let tiles = self.tiles(view);
        self.context.progress.begin("tiles", tiles);
        self.part(number, view, path).map(|_| ())
    }

    fn tiles(&self, view: &View) -> u64 {
        let tiling = &self.context.project.settings.segment.tiling;
        tiling.tile_count(view.camera.width, view.camera.height)
    }

    fn gather(&self, step: &StepDir, warnings: &Warnings) -> Result<Vec<VotingPhoto>> {
        let candidates = posed_photos(&self.epoch, warnings)?;
        let total = candidates.iter().map(|(view, _)| self.tiles(view)).sum();
        self.context.progress.begin("tiles", total);
        let mut photos: Vec<VotingPhoto> = Vec::new();
        let count = candidates.len();
        for (number, (view, path)) in candidates.into_iter().enumerate() {
            self.context
                .progress
                .detail(&format!("picture {} of {count}", number + 1));
            let part = self.part(number, &view, &path)?;
            let outcome: Outcome = read_json(&part.file(PHOTO))?;
            if let Some(reason) = outcome.reason {
                warnings.skipped(STEP, path.to_string_lossy(), reason);
            }
            let Some(instances) = outcome.instances else {
                continue;
            };
            step.take(&part, LABELS, &label_name(photos.len()))?;
            photos.push(VotingPhoto {
                camera: view.name,
                path,
                instances,
            });
        }
        check_any(&photos, &self.epoch, warnings)?;
        Ok(photos)
    }

    fn part(&self, number: usize, view: &View, path: &Path) -> Result<StepDir> {
        let mut is_made = false;
        let part = self
            .context
            .part((&self.name, &self.key), &Part::Photo(number).name(), |part| {
                is_made = true;
                let outcome = self.find(part, view, path)?;
                write_json(&part.file(PHOTO), &outcome)
            })?;
        if !is_made {
            self.context.progress.advance(self.tiles(view));
        }
        Ok(part)
    }

    fn find(&self, part: &StepDir, view: &View, path: &Path) -> Result<Outcome> {
        let progress = self.context.progress;
        let image = match read_rgb(path) {
            Ok(image) => image,
            Err(error) => {
                progress.advance(self.tiles(view));
                return Ok(Outcome::left_out(error.to_string()));
            }
        };
        let (found, expected) = (
            [image.width(), image.height()],
            [view.camera.width, view.camera.height],
        );

        if found != expected {
            progress.advance(self.tiles(view));
            let [[width, height], [camera_width, camera_height]] =
                [found, expected].map(|size| size.map(|px| px.to_string().into()));
            return Ok(Outcome::left_out(PHOTO_SIZE.say(&[
                ("width", width),
                ("height", height),
                ("camera_width", camera_width),
                ("camera_height", camera_height),
            ])));
        }

        let tiling = &self.context.project.settings.segment.tiling;
        let relief = match &self.ingested {
            Some(ingested) => {
                let params = &self.context.project.settings.label;
                Some(photo_relief(&ingested.tiles.surveyed, view, params, progress)?)
            }
            None => None,
        };
        let mut stones = segment_photo(self.detector()?, &image, relief.as_ref(), tiling, progress)?;
        if self.is_of_views {
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
    fn left_out(reason: impl Into<Said>) -> Self {
        Self {
            instances: None,
            reason: Some(reason.into()),
        }
    }
}

fn no_masks(context: &Context, epoch: &Epoch, error: &impl std::fmt::Display) -> Error {
    Error::Survey(format!(
        "epoch {:?} has no masks, and no detector can find its stones ({error}): add `masks = ...` (COCO json or a folder of \
         16-bit label PNGs) to the epoch, or `model = ...` to [segment], in {}",
        epoch.name,
        context.project.path.display()
    ))
}

/// Takes away what a view does not show, such as level ground, which is black: the detector sees its relief all the
/// same. An instance of which most goes is no stone.
fn drop_empty(stones: &mut Segmentation, view: &RgbImage) {
    let is_empty = |pixel: &[u8; 3]| *pixel == [0; 3];
    let mut counts: BTreeMap<u32, [usize; 2]> = BTreeMap::new();
    for (id, pixel) in stones.labels.data().iter().zip(view.data()) {
        counts.entry(*id).or_default()[usize::from(is_empty(pixel))] += 1;
    }
    stones
        .scores
        .retain(|id, _| counts.get(id).is_some_and(|[shown, empty]| shown >= empty));
    for (id, pixel) in stones.labels.data_mut().iter_mut().zip(view.data()) {
        if is_empty(pixel) || !stones.scores.contains_key(id) {
            *id = 0;
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

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::raster::Raster;

    #[test]
    fn what_a_view_leaves_black_is_no_stone() {
        // A stone on the wall, one that reaches over its foot, and one on the ground.
        let mut stones = Segmentation {
            labels: Raster::from_vec(4, 3, vec![1, 1, 2, 2, 1, 1, 2, 0, 3, 3, 2, 0]).unwrap(),
            scores: [1, 2, 3].map(|id| (id, 0.9)).into(),
        };
        let view = (0..12).map(|at| if at < 8 { [90; 3] } else { [0; 3] }).collect();
        drop_empty(&mut stones, &Raster::from_vec(4, 3, view).unwrap());
        assert_eq!(stones.labels.data(), [1, 1, 2, 2, 1, 1, 2, 0, 0, 0, 0, 0]);
        assert_eq!(stones.scores.into_keys().collect::<Vec<u32>>(), [1, 2]);
    }
}
