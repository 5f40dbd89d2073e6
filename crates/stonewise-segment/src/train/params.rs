//! Parameters of a training.

use super::optimizer::AdamWParams;
use super::schedule::{Schedule, Total};
use crate::augment::AugmentParams;
use crate::model::MaskRcnnConfig;
use serde::{Deserialize, Serialize};
use stonewise_core::params::{Params, Range, Ranged};

/// Everything that decides a training; kept in its checkpoints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainConfig {
    /// The detector.
    pub model: MaskRcnnConfig,
    /// How it is trained.
    pub training: TrainParams,
    /// How long in all.
    pub total: Total,
}

/// How a detector is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrainParams {
    /// Another seed draws other images and other samples of boxes.
    pub seed: u64,
    /// Edge of a training image, pixels.
    pub crop_px: u32,
    /// Images that go through the detector together.
    pub batch: usize,
    /// Batches whose gradients make one step; they are computed side by side.
    pub accumulate: usize,
    /// The learning rate.
    pub schedule: Schedule,
    /// The optimiser.
    pub optimizer: AdamWParams,
    /// Whether the detector learns relief beside colour. Rendered photos come with clouds then, of all kinds
    /// and none; weights that have not learnt relief start with zeros for it.
    pub relief: bool,
    /// How images cut from labelled photos vary; rendered photos vary by themselves.
    pub augment: AugmentParams,
    /// Minutes between checkpoints.
    pub checkpoint_minutes: f64,
    /// Steps between evaluations; 0 for none.
    pub evaluate_steps: u64,
}

impl Default for TrainParams {
    fn default() -> Self {
        Self {
            seed: 1,
            crop_px: 320,
            batch: 1,
            accumulate: 4,
            schedule: Schedule::default(),
            optimizer: AdamWParams::default(),
            relief: false,
            augment: AugmentParams::default(),
            checkpoint_minutes: 5.0,
            evaluate_steps: 500,
        }
    }
}

impl TrainParams {
    /// For a detector that has learnt before: a lower learning rate keeps what it has learnt, and fewer steps
    /// are enough.
    pub fn fine_tuning() -> Self {
        let from_scratch = Self::default();
        Self {
            schedule: Schedule {
                learning_rate: from_scratch.schedule.learning_rate / 3.0,
                warmup_steps: 50,
                ..from_scratch.schedule
            },
            evaluate_steps: 100,
            ..from_scratch
        }
    }

    /// Images of one step.
    pub fn images_per_step(&self) -> usize {
        self.batch * self.accumulate
    }
}

impl Params for TrainParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::between(64.0, f64::INFINITY).holds("crop_px", self.crop_px),
            Range::POSITIVE.holds("batch", self.batch),
            Range::POSITIVE.holds("accumulate", self.accumulate),
            Range::POSITIVE.holds("checkpoint_minutes", self.checkpoint_minutes),
        ]
    }

    fn parts(&self) -> Vec<(&'static str, &dyn Params)> {
        vec![("schedule", &self.schedule)]
    }
}
