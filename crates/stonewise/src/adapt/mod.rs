//! A detector that learns from the survey itself.
//!
//! What several posed photos and the cloud agree on is taken for true and taught; what is open is ignored.
//! Parts of the wall are kept apart, on which the detector is measured before and after; without a gain
//! nothing changes. Self-training (Scudder 1965), with photos and cloud as judges of each other.

mod gain;
mod lesson;
mod survey_photos;

use crate::error::Result;
use crate::files::write_readable_json;
use crate::output::OutputFolder;
use crate::pipeline::{Context, Run, Until};
use crate::project::Project;
use crate::segmentation::train_for;
use gain::Gain;
use lesson::lesson;
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_core::progress::Progress;
use stonewise_io::atomic::write_atomically;
use stonewise_segment::dataset::PhotoCrops;
use stonewise_segment::evaluation::{MaskScore, PhotoPairs};
use stonewise_segment::train::{Start, TrainParams, model_path, pair_samples};
use stonewise_segment::{StoneFinder, Weights};
use survey_photos::SurveyPhotos;

/// What was decided, in the output folder.
const RECORD: &str = "adapt.json";
/// Digits of a key that name the folder of a training.
const FOLDER_DIGITS: usize = 16;

/// What an adaptation did; also written as `adapt.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Adapted {
    /// Photos with something to learn from.
    pub photos: usize,
    /// Stones that the survey confirms.
    pub stones: usize,
    /// Of these, the stones that are kept for measuring.
    pub kept: usize,
    /// Masks that were taught, counted in each photo.
    pub masks: usize,
    /// Of these, masks of stones that the detector had missed in the photo.
    pub missed: usize,
    /// Steps of the training.
    pub steps: u64,
    /// Minutes of the training.
    pub minutes: f64,
    /// The detector at the start.
    pub from: PathBuf,
    /// Its figures on the stones that were kept.
    pub before: MaskScore,
    /// Those of the trained detector.
    pub after: MaskScore,
    /// Change of F1.
    pub gain: f64,
    /// Its 95 % interval, by a bootstrap over parts of the wall; absent where there are fewer than two.
    pub gain_interval: Option<[f64; 2]>,
    /// The trained detector, where it gained.
    pub model: Option<PathBuf>,
}

/// Trains the detector of a project on what the survey confirms, for `minutes` in all, and writes into the
/// folder `out`:
///
/// - `adapt.json`: what was taught, the figures before and after, and the decision,
/// - `model.safetensors`: the detector, if it finds the stones that were kept apart significantly better,
/// - `work`, `training`: steps and checkpoint, with which an interrupted call continues.
///
/// # Errors
/// Every epoch has masks, too few stones are confirmed, an input cannot be used, the training diverges, or the
/// caller stopped it.
pub fn adapt(
    project: &Project,
    minutes: f64,
    out: &OutputFolder,
    progress: &dyn Progress,
) -> Result<Adapted> {
    let context = Context::new(project, out, progress)?;
    let run = Run::new(&context, Until::Labelled);
    let lesson = lesson(&run)?;
    let params = &project.settings.segment;
    let from = Weights::named(&params.model);
    let training = TrainParams {
        relief: from.takes_relief()?,
        evaluate_steps: 0,
        ..TrainParams::fine_tuning()
    };
    let photos = SurveyPhotos::new(&lesson, training.relief, &project.settings.label);
    let crops = PhotoCrops::new(&photos, training.augment.clone(), training.crop_px, training.seed);
    let folder = out
        .path()
        .join("training")
        .join(&lesson.key.as_str()[..FOLDER_DIGITS]);
    let start = Start::Weights(from.clone());
    let no_images = || Ok(Vec::new());
    let elapsed = train_for(
        minutes,
        &folder,
        (&start, Some(training)),
        &crops,
        no_images,
        progress,
    )?;
    let kept = crops.validation()?;
    let trained = Weights::File(model_path(&folder));
    let found = |weights: &Weights| -> Result<Vec<PhotoPairs>> {
        let detector = StoneFinder::open(weights, params.tiling.min_score as f32)?;
        progress.begin("measuring", kept.len() as u64);
        Ok(pair_samples(&detector, &kept, progress)?)
    };
    let (before, after) = (found(&from)?, found(&trained)?);
    let gain = Gain::of(&before, &after, |label| lesson.block(label));
    let model = match gain.is_shown() {
        true => Some(publish(
            &model_path(&folder),
            &out.path().join("model.safetensors"),
        )?),
        false => None,
    };
    let adapted = Adapted {
        photos: lesson.photos.len(),
        stones: lesson.blocks.len(),
        kept: lesson.kept.len(),
        masks: lesson.photos.iter().map(|p| p.stones.len()).sum(),
        missed: lesson.photos.iter().map(|p| p.missed).sum(),
        steps: elapsed.steps,
        minutes: elapsed.seconds / 60.0,
        from: params.model.clone(),
        before: MaskScore::of(&before),
        after: MaskScore::of(&after),
        gain: gain.mean,
        gain_interval: gain.interval,
        model,
    };
    write_readable_json(&out.path().join(RECORD), &adapted)?;
    Ok(adapted)
}

/// Copies a file to its final name.
fn publish(from: &Path, to: &Path) -> Result<PathBuf> {
    write_atomically(to, |partial| fs::copy(from, partial).map(drop))
        .map_err(crate::error::Error::io("writing", to))?;
    Ok(to.to_owned())
}
