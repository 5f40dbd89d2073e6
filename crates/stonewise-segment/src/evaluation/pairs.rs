//! Stones found against reference stones, in one photo.

use crate::Segmentation;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::raster::{LabelImage, Raster};

/// Least intersection over union of a pair. From here on a mask fits one mask of the other image at most (two would
/// have to share pixels), but for ties at exactly one half.
const LEAST_IOU: f64 = 0.5;

/// What became of the stones of one photo.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PhotoPairs {
    /// Labels of the reference stones that count.
    pub references: Vec<u32>,
    /// Stones found, by label.
    pub found: Vec<FoundStone>,
}

/// A stone that was found, and the reference stone that it fits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoundStone {
    /// Its label.
    pub label: u32,
    /// How sure the detector was.
    pub score: f32,
    /// Intersection over union with the reference stone that it fits; `None` where there is none of at least
    /// one half.
    pub iou: Option<f64>,
    /// Label of that stone.
    pub reference: Option<u32>,
    /// Nothing is known about it unless it fits a stone that counts.
    pub is_unknown: bool,
}

impl FoundStone {
    /// Whether it counts among the stones found, right or wrong.
    pub fn counts(&self) -> bool {
        self.iou.is_some() || !self.is_unknown
    }
}

/// Pairs the stones found in a photo with reference stones, one to one, by descending overlap.
///
/// `ignore`: where the reference is not complete. All three images have one size; what lies beyond the
/// smallest is ignored. Cost: O(pixels log stones).
pub fn pair_masks(found: &Segmentation, reference: &LabelImage, ignore: &Raster<bool>) -> PhotoPairs {
    let counts = Counts::of(&found.labels, reference, ignore);
    let mut pairs: Vec<(f64, u32, u32)> = counts
        .overlap
        .iter()
        .map(|(&(f, r), &n)| {
            let union = counts.found[&f].pixels + counts.reference[&r].pixels - n;
            (n as f64 / union as f64, f, r)
        })
        .filter(|pair| pair.0 >= LEAST_IOU)
        .collect();
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut partner: BTreeMap<u32, (f64, u32)> = BTreeMap::new();
    let mut taken = BTreeSet::new();

    for (iou, f, r) in pairs {
        if !partner.contains_key(&f) && taken.insert(r) {
            partner.insert(f, (iou, r));
        }
    }

    let stone = |(label, extent): (&u32, &Extent)| {
        let partner = partner.get(label);
        let is_counted = |r: &u32| !counts.reference[r].is_mostly_ignored();
        let fits = partner.filter(|(_, r)| is_counted(r));
        FoundStone {
            label: *label,
            score: found.scores.get(label).copied().unwrap_or(1.0),
            iou: fits.map(|fit| fit.0),
            reference: fits.map(|fit| fit.1),
            is_unknown: extent.is_mostly_ignored() || partner.is_some_and(|(_, r)| !is_counted(r)),
        }
    };

    PhotoPairs {
        references: counts
            .reference
            .iter()
            .filter(|(_, extent)| !extent.is_mostly_ignored())
            .map(|(label, _)| *label)
            .collect(),
        found: counts.found.iter().map(stone).collect(),
    }
}

/// Pixels of a stone.
#[derive(Clone, Copy, Default)]
struct Extent {
    pixels: u64,
    ignored: u64,
}

impl Extent {
    fn add(&mut self, is_ignored: bool) {
        self.pixels += 1;
        self.ignored += u64::from(is_ignored);
    }

    fn is_mostly_ignored(&self) -> bool {
        2 * self.ignored > self.pixels
    }
}

#[derive(Default)]
struct Counts {
    found: BTreeMap<u32, Extent>,
    reference: BTreeMap<u32, Extent>,
    overlap: BTreeMap<(u32, u32), u64>,
}

impl Counts {
    fn of(found: &LabelImage, reference: &LabelImage, ignore: &Raster<bool>) -> Self {
        let mut counts = Self::default();
        for ((&f, &r), &ignored) in found.data().iter().zip(reference.data()).zip(ignore.data()) {
            if f != 0 {
                counts.found.entry(f).or_default().add(ignored);
            }
            if r != 0 {
                counts.reference.entry(r).or_default().add(ignored);
                if f != 0 {
                    *counts.overlap.entry((f, r)).or_default() += 1;
                }
            }
        }
        counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One row of pixels: labels as digits, `x` where the reference is not complete.
    fn paired(found: &str, reference: &str, ignore: &str) -> PhotoPairs {
        let width = found.len() as u32;
        let row = |text: &str| {
            let values = text.chars().map(|c| c.to_digit(10).unwrap_or(0)).collect();
            Raster::from_vec(width, 1, values).unwrap()
        };
        let ignore = Raster::from_vec(width, 1, ignore.chars().map(|c| c == 'x').collect()).unwrap();
        let found = Segmentation {
            labels: row(found),
            scores: BTreeMap::new(),
        };
        pair_masks(&found, &row(reference), &ignore)
    }

    #[test]
    fn masks_pair_from_one_half_on() {
        let found = paired("1111.22.33.", "1111.2..334", "...........").found;
        let ious: Vec<Option<f64>> = found.iter().map(|f| f.iou).collect();
        assert_eq!(ious, [Some(1.0), Some(0.5), Some(1.0)]);
        let less = paired("1111", "1...", "....");
        assert_eq!((less.references, less.found[0].iou), (vec![1], None));
    }

    #[test]
    fn a_mask_is_paired_once() {
        // Both halves of the reference stone have an IoU of one half.
        let pairs = paired("1122", "3333", "....");
        let fits: Vec<Option<u32>> = pairs.found.iter().map(|f| f.reference).collect();
        assert_eq!(fits, [Some(3), None]);
    }

    #[test]
    fn what_lies_mostly_outside_is_left_out() {
        let pairs = paired("111.222.333.44", "111.......3.44", "xx...xx.....xx");
        assert_eq!(pairs.references, [3]);
        let known: Vec<(Option<f64>, bool)> = pairs.found.iter().map(|f| (f.iou, f.is_unknown)).collect();
        assert_eq!(known, [(None, true), (None, true), (None, false), (None, true)]);
    }

    #[test]
    fn a_stone_that_counts_is_found_by_a_mask_that_reaches_far_out() {
        let pairs = paired("11111111", ".1111111", "xxxxx...");
        // Five of eight pixels of the mask are unknown, four of seven of the reference stone.
        assert!(pairs.references.is_empty());
        let pairs = paired("11111111", "..111111", "xxxxx...");
        assert_eq!((pairs.references, pairs.found[0].iou), (vec![1], Some(0.75)));
    }
}
