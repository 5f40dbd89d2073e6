//! Average precision as COCO defines it.

use super::pairs::{FoundStone, PhotoPairs};

/// Recall is sampled in steps of one hundredth.
const RECALL_STEPS: usize = 100;

/// Average precision over all photos where a stone is found from this IoU on; `None` without reference
/// stones.
///
/// Stones found are ranked by score (ties keep their order: photo by photo, by label); precision at a recall
/// is the best at that recall or a higher one, averaged over recalls 0, 0.01, ... 1. Source: the evaluation
/// code of COCO (Lin et al. 2014).
pub fn average_precision(photos: &[PhotoPairs], least_iou: f64) -> Option<f64> {
    let references: usize = photos.iter().map(|p| p.references.len()).sum();
    if references == 0 {
        return None;
    }
    let mut ranked: Vec<&FoundStone> = photos.iter().flat_map(|p| &p.found).collect();
    ranked.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut curve: Vec<(usize, f64)> = Vec::new();
    let (mut right, mut wrong) = (0usize, 0usize);

    for stone in ranked {
        if stone.iou.is_some_and(|iou| iou >= least_iou) {
            right += 1;
        } else if !stone.is_unknown {
            wrong += 1;
        } else {
            continue;
        }
        curve.push((right, right as f64 / (right + wrong) as f64));
    }

    let mut best = 0.0f64;
    for point in curve.iter_mut().rev() {
        best = best.max(point.1);
        point.1 = best;
    }

    let at = |step: usize| {
        // Whole numbers keep recalls such as 0.29 from slipping by a rounding error.
        let needed = curve.partition_point(|(right, _)| right * RECALL_STEPS < step * references);
        curve.get(needed).map_or(0.0, |point| point.1)
    };
    Some((0..=RECALL_STEPS).map(at).sum::<f64>() / (RECALL_STEPS + 1) as f64)
}

/// Mean of the average precision over IoU from 0.5 to 0.95 in steps of 0.05.
pub fn mean_average_precision(photos: &[PhotoPairs]) -> Option<f64> {
    let steps = 10;
    let sum: Option<f64> = (0..steps)
        .map(|i| average_precision(photos, f64::from(50 + 5 * i) / 100.0))
        .sum();
    sum.map(|sum| sum / f64::from(steps))
}
