//! The paper's segmentation: a detector trained on nine tenths of each photo and measured on the rest.

use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::project::Epoch;
use crate::segmentation::train_for;
use crate::settings::SegmentParams;
use crate::storage::step::Key;
use crate::storage::store::StepStore;
use std::path::{Path, PathBuf};
use stonewise_core::progress::Progress;
use stonewise_io::image_io::image_size;
use stonewise_segment::dataset::{LabelledPhotos, PhotoCrops};
use stonewise_segment::evaluation::{MaskScore, PhotoPairs, pair_masks};
use stonewise_segment::tiling::segment_photo;
use stonewise_segment::train::{Start, TrainParams, model_path};
use stonewise_segment::{StoneFinder, Weights};

/// The step that measures a detector.
const STEP: &str = "segmentation-score";
/// File with the pairs of stones of one photo, or with the scores over all photos.
const SCORE: &str = "score.json";
/// Digits of a key that name the folder of a training.
const FOLDER_DIGITS: usize = 16;

/// Detectors measured on the same labelled photos; one of them finds the stones of the surveys.
#[derive(Clone, Debug)]
pub(super) struct MeasuredDetectors {
    /// The photos, their masks and the detector at the start.
    key: Key,
    /// Surveys with these photos.
    pub surveys: Vec<String>,
    /// Photos with masks.
    pub photos: usize,
    /// The detector that finds the stones, as `[segment] model` names it.
    pub model: PathBuf,
    /// Each detector with its figures on the stones held out; the one that finds the stones comes first.
    pub scores: Vec<(String, MaskScore)>,
}

/// The training of a detector on labelled photos.
pub(super) struct DetectorTraining<'a> {
    /// The epoch whose photos have masks.
    pub epoch: &'a Epoch,
    /// Where the masks are complete; everywhere where absent.
    pub valid: Option<&'a Path>,
    /// The detector at the start, and how photos are cut into tiles.
    pub params: &'a SegmentParams,
    /// Minutes in total; 0: the detector is not trained.
    pub minutes: f64,
    /// Steps of the experiment.
    pub store: &'a StepStore,
    /// Where trainings lie, each in a folder of its own.
    pub out: &'a Path,
}

impl DetectorTraining<'_> {
    /// Trains, or resumes an interrupted training, and measures the detector before and after. If an earlier
    /// survey of the experiment has the same photos, masks and detector, its training is used. Returns the
    /// detector that finds the stones, as `[segment] model` names it.
    ///
    /// # Errors
    /// There are no masks, a file cannot be used, the training diverges, or the caller stopped it.
    pub(super) fn run(
        &self,
        survey: &str,
        earlier: &mut Vec<MeasuredDetectors>,
        progress: &dyn Progress,
    ) -> Result<PathBuf> {
        let key = self.key()?;
        if let Some(same) = earlier.iter_mut().find(|t| t.key == key) {
            same.surveys.push(survey.to_owned());
            return Ok(same.model.clone());
        }
        let photos = LabelledPhotos::open(self.images()?, self.masks()?, self.valid)?;
        let training = TrainParams::fine_tuning();
        let crops = PhotoCrops::new(&photos, training.augment.clone(), training.crop_px, training.seed);
        let measured = Measured {
            photos: &photos,
            crops: &crops,
            key: &key,
            params: self.params,
            store: self.store,
        };
        let before = Weights::named(&self.params.model);
        let mut scores = vec![(self.name(), measured.score(&self.name(), &before, progress)?)];
        let mut model = self.params.model.clone();
        if self.minutes > 0.0 {
            let folder = self.out.join(&key.as_str()[..FOLDER_DIGITS]);
            let name = self.train(&crops, &folder, progress)?;
            model = model_path(&folder);
            let after = Weights::File(model.clone());
            scores.insert(0, (name.clone(), measured.score(&name, &after, progress)?));
        }
        earlier.push(MeasuredDetectors {
            key,
            surveys: vec![survey.to_owned()],
            photos: photos.photos().len(),
            model: model.clone(),
            scores,
        });
        Ok(model)
    }

    fn images(&self) -> Result<&Path> {
        let photos = self.epoch.photos.as_ref().ok_or_else(|| {
            Error::Parameters(format!(
                "epoch {:?} has no photos with which a detector could be trained and measured: omit --train-minutes, or add `images`, \
                 `cameras` and `masks` to the epoch",
                self.epoch.name
            ))
        })?;
        Ok(&photos.images)
    }

    fn masks(&self) -> Result<&Path> {
        self.epoch.masks.as_deref().ok_or_else(|| {
            Error::Parameters(format!(
                "epoch {:?} has no masks with which a detector could be trained and measured: omit --train-minutes, or add `masks = ...` to the epoch",
                self.epoch.name
            ))
        })
    }

    /// The detector at the start, as tables name it.
    fn name(&self) -> String {
        format!("{} detector", self.params.model.display())
    }

    fn key(&self) -> Result<Key> {
        let before = self.store.weights_digest(&Weights::named(&self.params.model))?;
        let mut digests = vec![
            self.store.digest(self.masks()?)?,
            self.store.digest(self.images()?)?,
            before,
        ];
        if let Some(valid) = self.valid {
            digests.push(self.store.digest(valid)?);
        }
        let digests: Vec<&str> = digests.iter().map(String::as_str).collect();
        let params = (TrainParams::fine_tuning(), &self.params.tiling);
        Ok(Key::new("detector-training", &params, &digests))
    }

    /// Trains until the time is up, and returns the name of the detector.
    fn train(&self, crops: &PhotoCrops, folder: &Path, progress: &dyn Progress) -> Result<String> {
        let start = Start::Weights(Weights::named(&self.params.model));
        let validation = || Ok(crops.validation()?);
        let elapsed = train_for(self.minutes, folder, (&start, None), crops, validation, progress)?;
        Ok(format!(
            "trained on nine tenths of each photo ({} step{} in {:.1} min)",
            elapsed.steps,
            if elapsed.steps == 1 { "" } else { "s" },
            elapsed.seconds / 60.0
        ))
    }
}

/// The stones held out of labelled photos, and where scores on them are kept.
struct Measured<'a> {
    photos: &'a LabelledPhotos,
    crops: &'a PhotoCrops<'a>,
    key: &'a Key,
    params: &'a SegmentParams,
    store: &'a StepStore,
}

impl Measured<'_> {
    /// Scores a detector, which gets whole photos without relief, on the stones held out of them.
    fn score(&self, name: &str, weights: &Weights, progress: &dyn Progress) -> Result<MaskScore> {
        let digest = blake3::hash(&weights.bytes()?).to_hex().to_string();
        let key = Key::new(STEP, &(), &[self.key.as_str(), &digest]);
        let (dir, _) = self.store.step(STEP, key.clone(), &[], |dir| {
            let detector = StoneFinder::open(weights, self.params.tiling.min_score as f32)?;
            let paths = self.photos.photos();
            let tiles =
                |path: &PathBuf| image_size(path).map_or(0, |(w, h)| self.params.tiling.tile_count(w, h));
            progress.begin(&format!("measuring: {name}"), paths.iter().map(tiles).sum());
            let mut pairs: Vec<PhotoPairs> = Vec::new();
            for index in 0..paths.len() {
                progress.detail(&format!("photo {} of {}", index + 1, paths.len()));
                let part = self.store.part((STEP, &key), &format!("{index:05}"), |part| {
                    let sample = self.crops.held_out(index)?;
                    let found =
                        segment_photo(&detector, sample.image(), None, &self.params.tiling, progress)?;
                    write_json(
                        &part.file(SCORE),
                        &pair_masks(&found, sample.labels(), sample.ignore()),
                    )
                })?;
                pairs.push(read_json(&part.file(SCORE))?);
            }
            write_json(&dir.file(SCORE), &MaskScore::of(&pairs))
        })?;
        self.store.remove_parts(STEP, &key)?;
        read_json(&dir.file(SCORE))
    }
}
