//! The figures of an evaluation.

use super::average_precision::{average_precision, mean_average_precision};
use super::pairs::PhotoPairs;
use serde::{Deserialize, Serialize};

/// Figures over one or more photos; `None` where they are not defined.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MaskScore {
    /// Stones found, without those about which nothing is known.
    pub found: usize,
    /// Reference stones.
    pub references: usize,
    /// Stones found that fit a reference stone, one to one, with an IoU of at least 0.5.
    pub right: usize,
    /// `right` / `found`.
    pub precision: Option<f64>,
    /// `right` / `references`.
    pub recall: Option<f64>,
    /// Harmonic mean of precision and recall.
    pub f1: Option<f64>,
    /// Mean IoU of the stones that are right.
    pub mean_iou: Option<f64>,
    /// COCO's average precision at IoU 0.5.
    pub ap50: Option<f64>,
    /// COCO's average precision over IoU 0.5 to 0.95.
    pub ap: Option<f64>,
}

impl MaskScore {
    /// The figures of these photos taken together.
    pub fn of(photos: &[PhotoPairs]) -> Self {
        let stones = || photos.iter().flat_map(|p| &p.found);
        let ious = || stones().filter_map(|s| s.iou);
        let right = ious().count();
        let found = stones().filter(|s| s.counts()).count();
        let references = photos.iter().map(|p| p.references.len()).sum();
        let share = |n: usize, of: usize| (of > 0).then(|| n as f64 / of as f64);
        Self {
            found,
            references,
            right,
            precision: share(right, found),
            recall: share(right, references),
            f1: share(2 * right, found + references),
            mean_iou: (right > 0).then(|| ious().sum::<f64>() / right as f64),
            ap50: average_precision(photos, 0.5),
            ap: mean_average_precision(photos),
        }
    }
}
