//! Masks as a poor segmentation would draw them.

use rand::seq::{IndexedRandom, SliceRandom};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::evaluate::LabelConfusion;
use stonewise_core::raster::{LabelImage, Raster};

/// What is wrong with all masks of a photo; stones are chosen anew in every photo.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MaskError {
    /// Masks end this many pixels before the stone does.
    Eroded(u32),
    /// Masks end this many pixels behind the stone, or where the next one begins.
    Dilated(u32),
    /// This share of the stones shares its mask with a neighbour.
    Merged(f64),
    /// This share of the stones has two masks, cut by a line through the middle.
    Split(f64),
    /// This share of the stones has no mask.
    Missing(f64),
}

/// Labels with an error. `seed`: which stones are hit.
pub fn spoil_masks(labels: &LabelImage, error: MaskError, seed: u64) -> LabelImage {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    match error {
        MaskError::Eroded(pixels) => (0..pixels).fold(labels.clone(), |l, _| eroded(&l)),
        MaskError::Dilated(pixels) => (0..pixels).fold(labels.clone(), |l, _| dilated(&l)),
        MaskError::Merged(share) => merged(labels, share, &mut rng),
        MaskError::Split(share) => split(labels, share, &mut rng),
        MaskError::Missing(share) => {
            let hit = chosen(labels, share, &mut rng);
            relabelled(labels, |label, _, _| if hit.contains(&label) { 0 } else { label })
        }
    }
}

/// Mean over the true instances of the largest IoU that any instance has with them, zero where none overlaps;
/// `None` without true instances.
pub fn mean_iou(labels: &LabelImage, truth: &LabelImage) -> Option<f64> {
    let mut confusion = LabelConfusion::default();
    let pixels = labels.data().iter().zip(truth.data());
    pixels.for_each(|(predicted, truth)| confusion.add(*predicted, *truth));
    confusion.score_instances().mean_iou_all
}

fn relabelled(labels: &LabelImage, new: impl Fn(u32, u32, u32) -> u32) -> LabelImage {
    let width = labels.width();
    let mut out = labels.clone();
    for (i, label) in out.data_mut().iter_mut().enumerate() {
        if *label != 0 {
            *label = new(*label, i as u32 % width, i as u32 / width);
        }
    }
    out
}

/// Labels of the four pixels beside one; 0 outside.
fn beside(labels: &LabelImage, x: u32, y: u32) -> [u32; 4] {
    let at = |x: Option<u32>, y: Option<u32>| match (x, y) {
        (Some(x), Some(y)) => labels.get(x, y).copied().unwrap_or(0),
        _ => 0,
    };
    [
        at(x.checked_sub(1), Some(y)),
        at(Some(x + 1), Some(y)),
        at(Some(x), y.checked_sub(1)),
        at(Some(x), Some(y + 1)),
    ]
}

fn eroded(labels: &LabelImage) -> LabelImage {
    relabelled(labels, |label, x, y| {
        if beside(labels, x, y).iter().all(|b| *b == label) {
            label
        } else {
            0
        }
    })
}

fn dilated(labels: &LabelImage) -> LabelImage {
    let mut out: Raster<u32> = labels.clone();
    for y in 0..labels.height() {
        for x in 0..labels.width() {
            if labels.get(x, y) == Some(&0)
                && let Some(label) = beside(labels, x, y).into_iter().filter(|b| *b != 0).min()
                && let Some(place) = out.get_mut(x, y)
            {
                *place = label;
            }
        }
    }
    out
}

fn instances(labels: &LabelImage) -> Vec<u32> {
    let all: BTreeSet<u32> = labels.data().iter().copied().filter(|l| *l != 0).collect();
    all.into_iter().collect()
}

/// This share of the instances, at random.
fn chosen(labels: &LabelImage, share: f64, rng: &mut ChaCha8Rng) -> BTreeSet<u32> {
    let mut all = instances(labels);
    all.shuffle(rng);
    all.truncate((share * all.len() as f64).round() as usize);
    all.into_iter().collect()
}

/// Widest joint over which two stones are neighbours, pixels.
const JOINT_PX: u32 = 12;

/// Pairs of instances with nothing but a joint between them in a row or a column.
fn neighbours(labels: &LabelImage) -> BTreeMap<u32, BTreeSet<u32>> {
    let mut pairs: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    let mut scan = |line: &mut dyn Iterator<Item = u32>| {
        let (mut last, mut gap) = (0, u32::MAX);
        for label in line {
            if label == 0 {
                gap = gap.saturating_add(1);
                continue;
            }
            if last != 0 && label != last && gap <= JOINT_PX {
                pairs.entry(last).or_default().insert(label);
                pairs.entry(label).or_default().insert(last);
            }
            (last, gap) = (label, 0);
        }
    };
    let at = |x: u32, y: u32| labels.get(x, y).copied().unwrap_or(0);
    for y in 0..labels.height() {
        scan(&mut (0..labels.width()).map(|x| at(x, y)));
    }
    for x in 0..labels.width() {
        scan(&mut (0..labels.height()).map(|y| at(x, y)));
    }
    pairs
}

/// Stones in pairs until the share is reached; none is in two pairs.
fn merged(labels: &LabelImage, share: f64, rng: &mut ChaCha8Rng) -> LabelImage {
    let neighbours = neighbours(labels);
    let mut order = instances(labels);
    let wanted = (share * order.len() as f64).round() as usize;
    order.shuffle(rng);
    let mut partner: BTreeMap<u32, u32> = BTreeMap::new();
    let mut used: BTreeSet<u32> = BTreeSet::new();
    for label in order {
        if used.len() + 1 >= wanted.max(1) || used.contains(&label) {
            continue;
        }
        let free: Vec<u32> = neighbours
            .get(&label)
            .into_iter()
            .flatten()
            .copied()
            .filter(|n| !used.contains(n))
            .collect();
        if let Some(&other) = free.choose(rng) {
            partner.insert(label, other);
            used.extend([label, other]);
        }
    }
    relabelled(labels, |label, _, _| {
        partner.get(&label).copied().unwrap_or(label)
    })
}

fn split(labels: &LabelImage, share: f64, rng: &mut ChaCha8Rng) -> LabelImage {
    let mut sums: BTreeMap<u32, [f64; 3]> = BTreeMap::new();
    for (i, &label) in labels.data().iter().enumerate().filter(|(_, l)| **l != 0) {
        let (x, y) = (i as u32 % labels.width(), i as u32 / labels.width());
        let sum = sums.entry(label).or_default();
        *sum = [sum[0] + f64::from(x), sum[1] + f64::from(y), sum[2] + 1.0];
    }
    let largest = sums.keys().copied().max().unwrap_or(0);
    let cuts: BTreeMap<u32, [f64; 5]> = chosen(labels, share, rng)
        .into_iter()
        .zip(1..)
        .map(|(label, k)| {
            let [x, y, n] = sums[&label];
            let (sin, cos) = rng.random_range(0.0..std::f64::consts::PI).sin_cos();
            (label, [x / n, y / n, cos, sin, f64::from(largest + k)])
        })
        .collect();
    relabelled(labels, |label, x, y| match cuts.get(&label) {
        Some([cx, cy, nx, ny, new]) if (f64::from(x) - cx) * nx + (f64::from(y) - cy) * ny > 0.0 => {
            *new as u32
        }
        _ => label,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stones of 20 x 10 pixels with joints of 4 pixels, 5 by 6 of them.
    fn wall() -> LabelImage {
        let mut labels = LabelImage::filled(5 * 24, 6 * 14, 0);
        let width = labels.width();
        for (i, label) in labels.data_mut().iter_mut().enumerate() {
            let (x, y) = (i as u32 % width, i as u32 / width);
            if (2..22).contains(&(x % 24)) && (2..12).contains(&(y % 14)) {
                *label = 1 + x / 24 + 5 * (y / 14);
            }
        }
        labels
    }

    fn iou(error: MaskError) -> f64 {
        mean_iou(&spoil_masks(&wall(), error, 3), &wall()).unwrap()
    }

    #[test]
    fn masks_shrink_and_grow_by_whole_pixels() {
        assert_eq!(mean_iou(&wall(), &wall()), Some(1.0));
        assert!((iou(MaskError::Eroded(2)) - 16.0 * 6.0 / 200.0).abs() < 1e-12);
        // Growing by one step of four neighbours adds the four sides.
        assert!((iou(MaskError::Dilated(1)) - 200.0 / 260.0).abs() < 1e-12);
        let filled = spoil_masks(&wall(), MaskError::Dilated(40), 1);
        assert!(filled.data().iter().all(|l| *l != 0));
    }

    #[test]
    fn shares_of_stones_are_hit() {
        assert!((iou(MaskError::Missing(0.4)) - 0.6).abs() < 1e-12);
        // Of a merged pair each stone has an IoU of one half.
        assert!((iou(MaskError::Merged(0.4)) - 0.8).abs() < 1e-12);
        let halves = iou(MaskError::Split(0.4));
        assert!((halves - 0.8).abs() < 0.02, "{halves}");
        let split = spoil_masks(&wall(), MaskError::Split(0.4), 3);
        assert_eq!(instances(&split).len(), 42);
        let merged = spoil_masks(&wall(), MaskError::Merged(1.0), 3);
        assert!(instances(&merged).len() < 20);
    }

    #[test]
    fn the_seed_chooses_the_stones() {
        let hit = |seed| spoil_masks(&wall(), MaskError::Missing(0.3), seed);
        assert_eq!(hit(1), hit(1));
        assert_ne!(hit(1), hit(2));
        assert_eq!(mean_iou(&wall(), &LabelImage::filled(120, 84, 0)), None);
    }
}
