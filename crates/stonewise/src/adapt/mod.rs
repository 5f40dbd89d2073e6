//! A detector that learns from the survey itself.
//!
//! What several posed photos and the cloud agree on is taken for true and taught; what is open is ignored.
//! Parts of the wall are kept apart, on which the detector is measured before and after; without a gain
//! nothing changes. Self-training (Scudder 1965), with photos and cloud as judges of each other. Where a person
//! corrected stones, these are taught as they were corrected.

mod agreement;
mod changes;
mod gain;
mod lesson;
mod sight;
mod survey_photos;
#[cfg(test)]
mod testing;

use crate::error::Result;
use crate::files::write_readable_json;
use crate::output::OutputFolder;
use crate::pipeline::{Context, Run, Until};
use crate::project::Project;
use crate::results::Facade;
use crate::results::names::WORK_DIR;
use crate::segmentation::train_for;
use crate::storage::store::{Keeps, StepStore};
pub use agreement::Agreement;
use agreement::agreement;
pub use changes::{Fate, StoneChange};
use gain::{Gain, both, sum};
use lesson::lesson;
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::progress::Progress;
use stonewise_io::atomic::write_atomically;
use stonewise_segment::Weights;
use stonewise_segment::dataset::PhotoCrops;
use stonewise_segment::train::{Start, TrainParams, model_path};
use survey_photos::SurveyPhotos;

/// What was decided, in the output folder.
const RECORD: &str = "adapt.json";
/// The folder of trainings, in the output folder.
const TRAINING: &str = "training";
/// The steps of [`teach`], in words.
const TEACHING: [&str; 4] = [
    "stones as they were corrected",
    "training",
    "score on the blocks kept apart",
    "stones that would change",
];
/// Digits of a key that name the folder of a training.
const FOLDER_DIGITS: usize = 16;

/// What an adaptation did; also written as `adapt.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Adapted {
    /// Photos with something to learn from.
    pub photos: usize,
    /// Stones that the survey confirms.
    pub stones: usize,
    /// Confirmed stones that are kept for measuring.
    pub kept: usize,
    /// Masks that were taught, counted in each photo.
    pub masks: usize,
    /// Taught masks of stones that the detector had missed in the photo.
    pub missed: usize,
    /// Masks of stones that a person corrected, and masks that a person said are no stones.
    pub corrected: usize,
    /// Steps of the training.
    pub steps: u64,
    /// Minutes of the training.
    pub minutes: f64,
    /// The detector at the start.
    pub from: PathBuf,
    /// Agreement of its masks in the parts of the wall that were kept.
    pub before: Agreement,
    /// Agreement of the masks of the trained detector.
    pub after: Agreement,
    /// Change of F1.
    pub gain: f64,
    /// Its 95 % interval, by a bootstrap over parts of the wall; absent where there are fewer than two.
    pub gain_interval: Option<[f64; 2]>,
    /// The trained detector, where it gained.
    pub model: Option<PathBuf>,
}

/// Trains the detector of a project on what the survey confirms and a person corrected, for `minutes` in all, and
/// writes into the folder `out`:
///
/// - `adapt.json`: what was taught, the figures before and after, and the decision,
/// - `model.safetensors`: the detector, if its masks agree significantly better in the parts kept apart,
/// - `work`, `training`: steps and checkpoint, with which an interrupted call continues.
///
/// Cost: the training, and both detectors on all photos of epochs without masks.
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
    let store = every_step(out)?;
    let context = Context::with_store(project, out.path(), store, progress)?;
    let run = Run::new(&context, Until::Labelled);
    let (mut adapted, trained) = learn(&run, minutes, &out.path().join(TRAINING), &|_| {})?;
    if adapted.is_better() {
        adapted.model = Some(keep_detector(&trained, &out.path().join("model.safetensors"))?);
    }
    write_readable_json(&out.path().join(RECORD), &adapted)?;
    Ok(adapted)
}

/// What a person is offered after a training.
#[derive(Clone, Debug)]
pub struct Taught {
    /// What was taught, and the figures before and after.
    pub adapted: Adapted,
    /// The trained detector.
    pub model: PathBuf,
    /// The stones of the first epoch that it would change.
    pub changes: Vec<StoneChange>,
}

/// A store that keeps the steps of several detectors side by side.
fn every_step(out: &OutputFolder) -> Result<Arc<StepStore>> {
    let store = StepStore::new(&out.path().join(WORK_DIR), Keeps::Every)?;
    Ok(Arc::new(store))
}

/// Trains as [`adapt`], with the steps of a run in `results`, and finds out what the trained detector would change
/// there. Checkpoint and detector go into a folder in `training`; nothing else is changed, and an interrupted call
/// continues. Runs with the trained detector take over what was found out. `wall`: the unrolled wall of the changes.
///
/// Cost: the training, and the detector on all photos of epochs without masks.
///
/// # Errors
/// As [`adapt`].
pub fn teach(
    project: &Project,
    minutes: f64,
    (results, training): (&OutputFolder, &Path),
    wall: &Facade,
    progress: &dyn Progress,
) -> Result<Taught> {
    progress.agenda(&TEACHING.map(str::to_owned));
    let store = every_step(results)?;
    let context = |project| Context::with_store(project, results.path(), Arc::clone(&store), progress);
    let now = context(project)?;
    let run = Run::new(&now, Until::Labelled);
    let (adapted, model) = learn(&run, minutes, training, &|step| progress.enter(step))?;
    progress.enter(TEACHING.len() - 1);
    let with_it = with_detector(project, &model);
    let then = context(&with_it)?;
    let other = Run::new(&then, Until::Labelled);
    let first = [
        run.labelled(EpochId::REFERENCE)?,
        other.labelled(EpochId::REFERENCE)?,
    ];
    let changes = changes::changes((&now, &first[0]), (&then, &first[1]), wall)?;
    Ok(Taught {
        adapted,
        model,
        changes,
    })
}

/// Trains in a folder in `training`; returns what the adaptation did, and the detector. `at`: called with the step of
/// [`TEACHING`] that begins.
fn learn(run: &Run, minutes: f64, training: &Path, at: &dyn Fn(usize)) -> Result<(Adapted, PathBuf)> {
    let (project, progress) = (run.context.project, run.context.progress);
    at(0);
    let lesson = lesson(run)?;
    let params = &project.settings.segment;
    let from = Weights::named(&params.model);
    let trained_as = TrainParams {
        relief: from.takes_relief()?,
        evaluate_steps: 0,
        checkpoint_minutes: 1.0,
        ..TrainParams::fine_tuning()
    };
    let photos = SurveyPhotos::new(
        &lesson,
        lesson.to_learn_from(),
        trained_as.relief,
        &project.settings.label,
    );
    let crops = PhotoCrops::new(
        &photos,
        trained_as.augment.clone(),
        trained_as.crop_px,
        trained_as.seed,
    );
    let folder = training.join(&lesson.key.as_str()[..FOLDER_DIGITS]);
    let start = Start::Weights(from.clone());
    let no_images = || Ok(Vec::new());
    at(1);
    let elapsed = train_for(
        minutes,
        &folder,
        (&start, Some(trained_as.clone())),
        &crops,
        no_images,
        progress,
    )?;

    at(2);
    let model = model_path(&folder);
    let with_it = with_detector(project, &model);
    let then = Context::with_store(
        &with_it,
        &run.context.out,
        Arc::clone(&run.context.store),
        progress,
    )?;
    let other = Run::new(&then, Until::Labelled);
    let parts = both(&agreement(run, &lesson)?, &agreement(&other, &lesson)?);
    let [before, after] = sum(&parts);
    let gain = Gain::of(&parts);
    let adapted = Adapted {
        photos: lesson.photos.len(),
        stones: lesson.stones,
        kept: lesson.kept.len(),
        masks: lesson.photos.iter().map(|p| p.stones.len()).sum(),
        missed: lesson.photos.iter().map(|p| p.missed).sum(),
        corrected: lesson.photos.iter().map(|p| p.corrected.len() + p.deleted).sum(),
        steps: elapsed.steps,
        minutes: elapsed.seconds / 60.0,
        from: params.model.clone(),
        before: before.into(),
        after: after.into(),
        gain: gain.mean,
        gain_interval: gain.interval,
        model: None,
    };

    Ok((adapted, model))
}

/// The project with another detector.
fn with_detector(project: &Project, model: &Path) -> Project {
    let mut project = project.clone();
    project.settings.segment.model = model.to_owned();
    project
}

impl Adapted {
    /// Whether the gain is more than chance.
    pub fn is_better(&self) -> bool {
        Gain {
            mean: self.gain,
            interval: self.gain_interval,
        }
        .is_shown()
    }
}

/// Copies a trained detector to its final name, whole or not at all.
///
/// # Errors
/// It cannot be read or written.
pub fn keep_detector(from: &Path, to: &Path) -> Result<PathBuf> {
    write_atomically(to, |partial| fs::copy(from, partial).map(drop))
        .map_err(crate::error::Error::io("writing", to))?;
    Ok(to.to_owned())
}
