//! Matched pairs of stones with their points, batch by batch.

use super::window::Window;
use crate::cloud::Cloud;
use crate::id::StoneId;
use nalgebra::{Point3, Vector3};
use std::sync::Arc;

/// The points of a stone in both epochs. [`choose_points`](crate::registration::choose_points) chooses them from
/// labelled clouds in memory, [`MatchedPair::choose`](crate::registration::MatchedPair::choose) from what lies near a
/// stone.
#[derive(Clone, Debug)]
pub struct PairPoints {
    /// Stone of the first epoch.
    pub first: StoneId,
    /// Its partner in the second.
    pub second: StoneId,
    /// Centroid in the first epoch, world frame; the displacement is reported here.
    pub centroid: Point3<f64>,
    /// Centroid in the second epoch, world frame.
    pub centroid_second: Point3<f64>,
    /// Outward unit normal of the face around the stone, world frame.
    pub normal: Vector3<f64>,
    /// Points of the first epoch.
    pub points_first: Cloud,
    /// Points of the second epoch, unmoved.
    pub points_second: Cloud,
    /// Points of the second epoch near the stone without its label, unmoved: they count where the window says
    /// so.
    pub nearby_second: Cloud,
    /// Where points count; `None`: all of the stone's, none nearby.
    pub window: Option<Arc<Window>>,
}

/// Matched pairs in batches, so that a survey's points need not be in memory at once.
///
/// Batches hold neighbouring stones; each always holds the same pairs with the same points in the same order.
pub trait PairSource: Sync {
    /// Why a batch could not be read.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Number of batches.
    fn batch_count(&self) -> usize;
    /// The pairs of a batch.
    ///
    /// # Errors
    /// The batch cannot be read.
    fn load(&self, batch: usize) -> Result<Vec<PairPoints>, Self::Error>;
}

/// Pairs that are all in memory: for tests and for small surveys.
#[derive(Debug)]
pub struct MemoryPairs {
    pairs: Vec<PairPoints>,
}

/// Pairs in a batch of [`MemoryPairs`]: enough to occupy all threads, few enough to need little memory.
const BATCH: usize = 64;

impl MemoryPairs {
    /// Keeps the pairs in this order.
    pub fn new(pairs: Vec<PairPoints>) -> Self {
        Self { pairs }
    }

    /// All pairs, in order.
    pub fn pairs(&self) -> &[PairPoints] {
        &self.pairs
    }
}

impl PairSource for MemoryPairs {
    type Error = std::convert::Infallible;

    fn batch_count(&self) -> usize {
        self.pairs.len().div_ceil(BATCH)
    }

    fn load(&self, batch: usize) -> Result<Vec<PairPoints>, Self::Error> {
        Ok(self
            .pairs
            .iter()
            .skip(batch * BATCH)
            .take(BATCH)
            .cloned()
            .collect())
    }
}
