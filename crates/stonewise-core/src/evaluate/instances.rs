//! Instances found against true instances.

use crate::evaluate::LabelConfusion;
use crate::evaluate::detection::share;
use std::collections::{BTreeMap, BTreeSet};

/// Intersection over union from which an instance counts as found.
const FOUND_IOU: f64 = 0.5;

/// Detection quality of instances, as Mask R-CNN results are scored.
#[derive(Clone, Debug, PartialEq)]
pub struct InstanceScore {
    /// Predicted instances.
    pub predicted: usize,
    /// True instances.
    pub truth: usize,
    /// Pairs with an IoU of at least 0.5.
    pub found: usize,
    /// `found` / `predicted`.
    pub precision: Option<f64>,
    /// `found` / `truth`.
    pub recall: Option<f64>,
    /// Harmonic mean of precision and recall.
    pub f1: Option<f64>,
    /// Mean IoU of the pairs found.
    pub mean_iou_found: Option<f64>,
    /// Mean over all true instances of their largest IoU, zero where nothing overlaps.
    pub mean_iou_all: Option<f64>,
}

impl LabelConfusion {
    /// Precision, recall, F1 and IoU of the predicted stones against the true ones.
    pub fn score_instances(&self) -> InstanceScore {
        InstanceScore::of(self)
    }
}

impl InstanceScore {
    /// Pairs predicted and true instances one to one by descending IoU.
    fn of(confusion: &LabelConfusion) -> Self {
        let (predicted, truth) = (confusion.predicted_sizes(), confusion.true_sizes());
        let size = |sizes: &BTreeMap<u32, u64>, id: u32| sizes.get(&id).copied().unwrap_or(0);
        let mut pairs: Vec<(f64, u32, u32)> = confusion
            .overlaps()
            .map(|(p, t, n)| {
                (
                    n as f64 / (size(&predicted, p) + size(&truth, t) - n) as f64,
                    p,
                    t,
                )
            })
            .collect();
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut largest: BTreeMap<u32, f64> = BTreeMap::new();

        let (mut used_p, mut used_t) = (BTreeSet::new(), BTreeSet::new());
        let mut found = Vec::new();
        for (iou, p, t) in pairs {
            largest.entry(t).or_insert(iou);
            if iou >= FOUND_IOU && !used_p.contains(&p) && !used_t.contains(&t) {
                used_p.insert(p);
                used_t.insert(t);
                found.push(iou);
            }
        }

        Self {
            predicted: predicted.len(),
            truth: truth.len(),
            found: found.len(),
            precision: share(found.len(), predicted.len()),
            recall: share(found.len(), truth.len()),
            f1: share(2 * found.len(), predicted.len() + truth.len()),
            mean_iou_found: mean(found.iter().copied(), found.len()),
            mean_iou_all: mean(largest.values().copied(), truth.len()),
        }
    }
}

fn mean(values: impl Iterator<Item = f64>, count: usize) -> Option<f64> {
    (count > 0).then(|| values.sum::<f64>() / count as f64)
}
