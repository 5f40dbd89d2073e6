//! A training from start or checkpoint to its end.

use super::checkpoint::checkpoint_path;
use super::curve::Curve;
use super::curve_columns::{LOSS_DESCRIPTION, VALIDATION_DESCRIPTION, loss_columns, validation_columns};
use super::error::TrainError;
use super::plot::draw_curves;
use super::source::{Prefetch, SampleSource};
use super::trainer::{StepFigures, Trainer};
use crate::evaluation::{MaskScore, PhotoPairs, pair_masks};
use crate::model::{Precision, save_model};
use crate::tiling::{TilingError, TilingOptions, segment_photo};
use crate::{Detector, Sample, StoneFinder};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use stonewise_core::progress::{Progress, Silent};

/// Names of the curves.
const LOSS: &str = "loss.csv";
const VALIDATION: &str = "validation.csv";

/// Why a run of a training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The whole training is done.
    Finished,
    /// The time of this run is over; the same call continues.
    TimeIsUp,
    /// The caller cancelled it; the same call continues.
    Interrupted,
}

/// What a run of a training works with.
pub struct Run<'a> {
    /// Images to learn from.
    pub source: &'a dyn SampleSource,
    /// Images to measure on, never learnt from.
    pub validation: &'a [Sample],
    /// Folder of the checkpoint, the model and the curves; it exists.
    pub out: &'a Path,
    /// Ends this run after this many minutes.
    pub minutes: Option<f64>,
    /// Threads that make images while the detector learns.
    pub threads: usize,
    /// Whom to tell, and who may stop the run.
    pub progress: &'a dyn Progress,
}

impl Run<'_> {
    /// Trains until the total is reached, the time is up or the caller stops it; leaves in the folder
    ///
    /// - `checkpoint.safetensors`: everything needed to go on, written every few minutes and at the end,
    /// - `model.safetensors`: the detector, to be used,
    /// - `loss.csv`: losses of every step, `validation.csv`: figures on the validation images, `curves.svg`:
    ///   both as a picture.
    ///
    /// # Errors
    /// The loss diverges, an image cannot be made, a file cannot be written.
    pub fn train(&self, trainer: &mut Trainer) -> Result<Stop, TrainError> {
        let mut curves = Curves::open(self.out, trainer.elapsed().steps)?;
        let per_step = trainer.config().training.images_per_step();
        let first = trainer.elapsed().steps * per_step as u64;
        std::thread::scope(|scope| {
            let mut feed = Prefetch::start(scope, self.source, first, self.threads, per_step);
            self.steps(trainer, &mut feed, &mut curves)
        })
    }

    fn steps(
        &self,
        trainer: &mut Trainer,
        feed: &mut Prefetch,
        curves: &mut Curves,
    ) -> Result<Stop, TrainError> {
        let training = trainer.config().training.clone();
        let started = Instant::now();
        let mut clock = Instant::now();
        let mut saved = Instant::now();
        let between_saves = Duration::from_secs_f64(60.0 * training.checkpoint_minutes);
        self.progress.begin("training", Self::PARTS);
        let mut shown = 0;
        let stop = loop {
            let share_done = trainer.config().total.share_done(trainer.elapsed());
            let part = (share_done * Self::PARTS as f64) as u64;
            self.progress.advance(part.saturating_sub(shown));
            shown = part.max(shown);
            if share_done >= 1.0 {
                break Stop::Finished;
            }
            if self.progress.is_cancelled() {
                break Stop::Interrupted;
            }
            if self
                .minutes
                .is_some_and(|m| started.elapsed().as_secs_f64() >= 60.0 * m)
            {
                break Stop::TimeIsUp;
            }
            let waiting = Instant::now();
            let images = (0..training.images_per_step())
                .map(|_| feed.take())
                .collect::<Result<Vec<_>, _>>()
                .map_err(TrainError::Data)?;
            let waited = waiting.elapsed();
            let figures = trainer.step(&images)?;
            trainer.add_seconds(clock.elapsed().as_secs_f64());
            clock = Instant::now();
            curves.step(trainer, &figures, waited)?;
            let steps = trainer.elapsed().steps;
            if training.evaluate_steps > 0 && steps.is_multiple_of(training.evaluate_steps) {
                curves.validation(trainer, &self.evaluate(trainer)?)?;
            }
            if saved.elapsed() >= between_saves {
                self.save(trainer)?;
                saved = Instant::now();
            }
        };

        self.save(trainer)?;
        Ok(stop)
    }

    /// Units of progress of a whole training.
    const PARTS: u64 = 1000;

    fn save(&self, trainer: &Trainer) -> Result<(), TrainError> {
        trainer.save(&checkpoint_path(self.out))?;
        save_model(trainer.model(), &model_path(self.out), Precision::Half)?;
        let [loss, validation, picture] = [LOSS, VALIDATION, "curves.svg"].map(|name| self.out.join(name));
        draw_curves(&loss, &validation, &picture)
    }

    fn evaluate(&self, trainer: &Trainer) -> Result<MaskScore, TrainError> {
        let detector = StoneFinder::new(trainer.model().clone());
        evaluate_samples(&detector, self.validation).map_err(|e| TrainError::Data(e.to_string()))
    }
}

/// The figures of a detector on images that it sees as a whole.
///
/// # Errors
/// The detector could not run.
pub fn evaluate_samples<D: Detector>(
    detector: &D,
    samples: &[Sample],
) -> Result<MaskScore, TilingError<D::Error>> {
    let pairs = samples.iter().map(|sample| {
        let options = TilingOptions::whole(sample.image());
        let found = segment_photo(detector, sample.image(), 1.0, sample.relief(), &options, &Silent)?;
        Ok(pair_masks(&found, sample.labels(), sample.ignore()))
    });
    let pairs: Vec<PhotoPairs> = pairs.collect::<Result<_, TilingError<D::Error>>>()?;
    Ok(MaskScore::of(&pairs))
}

/// Where a training leaves its detector.
pub fn model_path(out: &Path) -> PathBuf {
    out.join("model.safetensors")
}

struct Curves {
    loss: Curve,
    validation: Curve,
}

impl Curves {
    fn open(out: &Path, steps: u64) -> Result<Self, TrainError> {
        let (loss, validation) = (loss_columns()?, validation_columns()?);
        Ok(Self {
            loss: Curve::open(&out.join(LOSS), &loss, LOSS_DESCRIPTION, steps)?,
            validation: Curve::open(&out.join(VALIDATION), &validation, VALIDATION_DESCRIPTION, steps)?,
        })
    }

    fn step(&mut self, trainer: &Trainer, figures: &StepFigures, waited: Duration) -> Result<(), TrainError> {
        let elapsed = trainer.elapsed();
        let mut row = vec![
            elapsed.seconds,
            figures.rate,
            figures.gradient_norm,
            waited.as_secs_f64(),
        ];
        row.extend(figures.losses);
        row.push(figures.total());
        self.loss.add(elapsed.steps, &row)
    }

    fn validation(&mut self, trainer: &Trainer, score: &MaskScore) -> Result<(), TrainError> {
        let elapsed = trainer.elapsed();
        let figures = [
            score.precision,
            score.recall,
            score.f1,
            score.mean_iou,
            score.ap50,
            score.ap,
        ];
        let mut row = vec![elapsed.seconds];
        row.extend(figures.map(|f| f.unwrap_or(0.0)));
        self.validation.add(elapsed.steps, &row)
    }
}
