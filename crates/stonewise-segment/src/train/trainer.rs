//! One step of training after the other.

use super::checkpoint::Checkpoint;
use super::error::TrainError;
use super::optimizer::AdamW;
use super::params::TrainConfig;
use super::schedule::Elapsed;
use crate::Sample;
use crate::model::{Gradients, Losses, MaskRcnn};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::path::Path;

/// A detector in training.
pub struct Trainer {
    config: TrainConfig,
    elapsed: Elapsed,
    model: MaskRcnn,
    optimizer: AdamW,
    pools: Vec<ThreadPool>,
}

/// Figures of one step; losses are means over its batches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepFigures {
    /// Learning rate.
    pub rate: f64,
    /// Losses in the order of [`StepFigures::LOSSES`].
    pub losses: [f64; 5],
    /// Length of the gradient before clipping.
    pub gradient_norm: f64,
}

impl StepFigures {
    /// Names of the parts of the loss.
    pub const LOSSES: [&str; 5] = ["rpn_objectness", "rpn_box", "class", "box", "mask"];

    /// Sum of the losses.
    pub fn total(&self) -> f64 {
        self.losses.iter().sum()
    }
}

impl Trainer {
    /// Starts a training of a detector that was made as `config.model` says.
    ///
    /// # Errors
    /// No threads can be started.
    pub fn new(config: TrainConfig, model: MaskRcnn) -> Result<Self, TrainError> {
        Ok(Self {
            optimizer: AdamW::new(config.training.optimizer),
            pools: pools(config.training.accumulate)?,
            elapsed: Elapsed::default(),
            config,
            model,
        })
    }

    /// Takes up a training where its checkpoint was written.
    ///
    /// # Errors
    /// The file cannot be read, is no checkpoint, or was made by another version of the detector.
    pub fn resume(path: &Path) -> Result<Self, TrainError> {
        let mut checkpoint: Checkpoint<TrainConfig> = Checkpoint::read(path)?;
        let config = checkpoint.config;
        let mut model = MaskRcnn::zeros(&config.model)?;
        for (name, param) in model.parameters() {
            match checkpoint.parameters.remove(&name) {
                Some(tensor) if tensor.shape() == param.tensor.shape() => param.tensor = tensor,
                _ => {
                    return Err(TrainError::Checkpoint {
                        path: path.to_owned(),
                        problem: format!("parameter {name} is missing or has another shape"),
                    });
                }
            }
        }
        let steps = i32::try_from(checkpoint.elapsed.steps).unwrap_or(i32::MAX);
        Ok(Self {
            optimizer: AdamW::from_state(config.training.optimizer, checkpoint.moments, steps),
            pools: pools(config.training.accumulate)?,
            elapsed: checkpoint.elapsed,
            config,
            model,
        })
    }

    /// Writes everything that [`Trainer::resume`] needs.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), TrainError> {
        let mut model = self.model.clone();
        let parameters = model.parameters().into_iter();
        let checkpoint = Checkpoint {
            elapsed: self.elapsed,
            config: self.config.clone(),
            parameters: parameters
                .map(|(name, param)| (name, param.tensor.clone()))
                .collect(),
            moments: self.optimizer.moments().clone(),
        };
        checkpoint.write(path)
    }

    /// Trains on the images of one step, `batch` at a time; the batches are computed side by side.
    ///
    /// # Errors
    /// The loss or its gradient is not finite; the detector is left as it was.
    pub fn step(&mut self, images: &[Sample]) -> Result<StepFigures, TrainError> {
        let rate = self
            .config
            .training
            .schedule
            .rate(&self.config.total, &self.elapsed);
        let mut figures = StepFigures {
            rate,
            ..StepFigures::default()
        };
        let batches = self.batches(images);
        let count = batches.len() as f64;
        let mut sum = Gradients::default();

        for (losses, gradients) in batches {
            for (mean, loss) in figures.losses.iter_mut().zip(losses.parts()) {
                *mean += f64::from(loss) / count;
            }
            sum.add(gradients);
        }

        if !figures.total().is_finite() {
            return Err(self.diverged("the loss", figures.total(), rate));
        }
        sum.scale(1.0 / count as f32);
        let norm = self.optimizer.step(&mut self.model, sum, rate);
        if !norm.is_finite() {
            return Err(self.diverged("the gradient", norm, rate));
        }
        figures.gradient_norm = norm;
        self.elapsed.steps += 1;
        Ok(figures)
    }

    /// Losses and gradients of every batch of a step, each computed by threads of its own: one image is too
    /// little work to share.
    fn batches(&self, images: &[Sample]) -> Vec<(Losses, Gradients)> {
        std::thread::scope(|scope| {
            let batches = images.chunks(self.config.training.batch.max(1)).enumerate();
            let mut running = Vec::new();
            for ((index, batch), pool) in batches.zip(self.pools.iter().cycle()) {
                let (model, seed) = (&self.model, self.batch_seed(index));
                let compute = move || model.gradients(batch, seed);
                running.push(scope.spawn(move || pool.install(compute)));
            }
            running
                .into_iter()
                .map(|batch| {
                    batch
                        .join()
                        .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
                })
                .collect()
        })
    }

    /// Counts time spent in training.
    pub fn add_seconds(&mut self, seconds: f64) {
        self.elapsed.seconds += seconds;
    }

    /// Replaces how long the training lasts in all.
    pub fn set_total(&mut self, total: super::Total) {
        self.config.total = total;
    }

    /// How far the training has come.
    pub fn elapsed(&self) -> &Elapsed {
        &self.elapsed
    }

    /// Its configuration.
    pub fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// The detector as it is now.
    pub fn model(&self) -> &MaskRcnn {
        &self.model
    }

    /// Seeds the draws of a batch: the same when a step is done again.
    fn batch_seed(&self, batch: usize) -> u64 {
        let number = self.elapsed.steps * self.config.training.accumulate as u64 + batch as u64;
        crate::seed::mix(self.config.training.seed, number)
    }

    fn diverged(&self, what: &'static str, value: f64, rate: f64) -> TrainError {
        TrainError::Diverged {
            step: self.elapsed.steps + 1,
            what,
            value,
            rate,
        }
    }
}

/// Threads for batches that are computed side by side: the cores, divided among them.
fn pools(count: usize) -> Result<Vec<ThreadPool>, TrainError> {
    let threads = (rayon::current_num_threads() / count.max(1)).max(1);
    let pool = || ThreadPoolBuilder::new().num_threads(threads).build();
    (0..count.max(1))
        .map(|_| pool().map_err(|e| TrainError::Data(format!("cannot start threads: {e}"))))
        .collect()
}
