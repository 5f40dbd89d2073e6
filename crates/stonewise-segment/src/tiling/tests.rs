//! Tiling with a detector that makes no mistakes: it reads the stones from the colours of the image.

use super::*;
use crate::{Detection, Detector, Patch, Segmentation};
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;
use stonewise_core::progress::Silent;
use stonewise_core::raster::{LabelImage, Raster, ReliefMap, RgbImage, connected_components};

/// Levels of a colour channel, far enough apart to be distinguished when pixels are averaged.
const LEVELS: [u8; 4] = [0, 85, 170, 255];

/// Cells around points of a jittered grid, with joints between them; every fifth cell swallows a neighbour.
fn wall(width: u32, height: u32, pitch: u32) -> LabelImage {
    let columns = width.div_ceil(pitch) + 1;
    let jitter = |i: u32| f64::from(i.wrapping_mul(2_654_435_761) >> 20) / 4096.0 * 0.6 * f64::from(pitch);
    let points: Vec<[f64; 2]> = (0..columns * (height.div_ceil(pitch) + 1))
        .map(|i| {
            let corner = [i % columns, i / columns].map(|v| f64::from(v * pitch));
            [corner[0] + jitter(2 * i), corner[1] + jitter(2 * i + 1)]
        })
        .collect();
    let stone = |i: usize| if i % 5 == 1 { i - 1 } else { i } as u32 % 63 + 1;
    let mut labels = Raster::filled(width, height, 0);
    for y in 0..height {
        for x in 0..width {
            let distance = |p: &[f64; 2]| (f64::from(x) - p[0]).hypot(f64::from(y) - p[1]);
            let mut near: Vec<(f64, u32)> = points
                .iter()
                .enumerate()
                .map(|(i, p)| (distance(p), stone(i)))
                .collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0));
            let own = near[0];
            let other = near.iter().find(|n| n.1 != own.1).unwrap();
            if other.0 - own.0 > 3.0 {
                *labels.get_mut(x, y).unwrap() = own.1;
            }
        }
    }
    labels
}

fn coloured(labels: &LabelImage) -> RgbImage {
    let colour = |&l: &u32| [l & 3, l >> 2 & 3, l >> 4 & 3].map(|i| LEVELS[i as usize]);
    let pixels = labels.data().iter().map(colour).collect();
    Raster::from_vec(labels.width(), labels.height(), pixels).unwrap()
}

/// Finds every connected part of one colour, but for the specks of other colours that averaging makes along
/// borders.
struct Oracle;

/// Larger than any speck, smaller than any stone.
const SPECK_PX: u32 = 30;

impl Detector for Oracle {
    type Error = Infallible;

    fn detect(&self, image: &RgbImage, _: Option<&ReliefMap>) -> Result<Vec<Detection>, Infallible> {
        let label = |c: &[u8; 3]| {
            let level = |v: u8| (u32::from(v) + 42) / 85;
            level(c[0]) | level(c[1]) << 2 | level(c[2]) << 4
        };
        let labels = image.data().iter().map(label).collect();
        let labels = Raster::from_vec(image.width(), image.height(), labels).unwrap();
        let (numbers, parts) = connected_components(&labels);
        let stones = (1u32..).zip(&parts).filter(|(_, part)| part.area > SPECK_PX);
        Ok(stones.map(|(n, _)| detection(&numbers, n)).collect())
    }
}

fn detection(numbers: &LabelImage, number: u32) -> Detection {
    let (mut left, mut top, mut right, mut bottom) = (u32::MAX, u32::MAX, 0, 0);
    let is_in = |x, y| numbers.get(x, y) == Some(&number);
    for y in 0..numbers.height() {
        for x in (0..numbers.width()).filter(|&x| is_in(x, y)) {
            (left, right) = (left.min(x), right.max(x + 1));
            (top, bottom) = (top.min(y), bottom.max(y + 1));
        }
    }
    let pixels = (top..bottom)
        .flat_map(|y| (left..right).map(move |x| is_in(x, y)))
        .collect();
    Detection {
        bounds: [left, top, right, bottom].map(|v| v as f32),
        score: 0.9,
        mask: Patch {
            left,
            top,
            pixels: Raster::from_vec(right - left, bottom - top, pixels).unwrap(),
        },
    }
}

fn options(tile_px: u32, overlap_px: u32, scales: &[f64]) -> TilingOptions {
    TilingOptions {
        tile_px,
        overlap_px,
        scales: scales.to_vec(),
        stone_px: 30.0,
        min_area_px: SPECK_PX,
        ..TilingOptions::default()
    }
}

fn segmented(labels: &LabelImage, options: &TilingOptions) -> Segmentation {
    segment_photo(&Oracle, &coloured(labels), 1.0, None, options, &Silent).unwrap()
}

/// The share of the pixels of stones that the same stone covers, where stones are paired by most pixels.
fn agreement(found: &LabelImage, truth: &LabelImage) -> f64 {
    let (truth, parts) = connected_components(truth);
    let mut overlap: BTreeMap<(u32, u32), u64> = BTreeMap::new();
    for pair in truth.data().iter().copied().zip(found.data().iter().copied()) {
        *overlap.entry(pair).or_default() += 1;
    }
    let best = |n: u32| {
        let own = overlap
            .range((n, 1)..(n + 1, 0))
            .map(|(pair, count)| (*count, pair.1));
        own.max().unwrap_or((0, 0))
    };
    let right: u64 = (1..=parts.len() as u32).map(|n| best(n).0).sum();
    right as f64 / parts.iter().map(|p| f64::from(p.area)).sum::<f64>()
}

#[test]
fn tiles_of_any_size_give_the_stones_of_the_whole_photo() {
    let truth = wall(230, 170, 24);
    let whole = segmented(&truth, &options(400, 0, &[1.0]));
    assert!(agreement(&whole.labels, &truth) > 0.99);
    for (tile, overlap) in [(64, 32), (64, 9), (90, 30), (101, 17)] {
        let found = segmented(&truth, &options(tile, overlap, &[1.0]));
        assert_eq!(found, whole, "tiles of {tile} px, overlap {overlap} px");
    }
}

#[test]
fn a_coarser_scale_adds_nothing_where_the_finer_one_sees_whole_stones() {
    let truth = wall(230, 170, 24);
    let fine = segmented(&truth, &options(96, 48, &[1.0]));
    let both = segmented(&truth, &options(96, 48, &[1.0, 0.5]));
    let extra = both.scores.len().abs_diff(fine.scores.len());
    let share = agreement(&both.labels, &truth);
    assert!(extra < 3 && share > 0.97, "{extra} {share}");
}

#[test]
fn stones_larger_than_a_tile_are_found_at_the_coarser_scale() {
    let truth = wall(600, 480, 120);
    let found = segmented(&truth, &options(128, 64, &[1.0, 0.25]));
    let (_, parts) = connected_components(&truth);
    assert!(agreement(&found.labels, &truth) > 0.95);
    let large = parts.iter().filter(|p| p.area > 100).count();
    assert!(
        found.scores.len() <= large + 3,
        "{} of {large}",
        found.scores.len()
    );
}

#[test]
fn scores_below_the_threshold_and_small_stones_are_dropped() {
    let truth = wall(230, 170, 24);
    let strict = TilingOptions {
        min_score: 0.95,
        ..options(400, 0, &[1.0])
    };
    assert!(segmented(&truth, &strict).scores.is_empty());
    let large = TilingOptions {
        min_area_px: 400,
        ..options(400, 0, &[1.0])
    };
    let (_, parts) = connected_components(&truth);
    let expected = parts.iter().filter(|p| p.area >= 400).count();
    assert_eq!(segmented(&truth, &large).scores.len(), expected);
}

/// Sees no stone under 400 pixels of what it is given.
struct Shortsighted;

impl Detector for Shortsighted {
    type Error = Infallible;

    fn detect(&self, image: &RgbImage, _: Option<&ReliefMap>) -> Result<Vec<Detection>, Infallible> {
        let all = Oracle.detect(image, None)?;
        let is_large = |d: &Detection| d.mask.pixels.data().iter().filter(|p| **p).count() >= 400;
        Ok(all.into_iter().filter(is_large).collect())
    }
}

#[test]
fn small_stones_are_found_enlarged_and_only_their_part_of_the_photo_is() {
    let small = wall(240, 240, 24);
    let mut labels = Raster::filled(900, 240, 0);
    for y in 0..240 {
        for x in 0..240 {
            *labels.get_mut(x, y).unwrap() = *small.get(x, y).unwrap();
        }
    }

    let photo = coloured(&labels);
    let tiles = AtomicU32::new(0);
    let found = |scales: &[f64]| {
        let detector = Counting(&tiles);
        let options = TilingOptions {
            stone_px: 60.0,
            ..options(200, 60, scales)
        };
        segment_photo(&detector, &photo, 1.0, None, &options, &Silent)
            .unwrap()
            .scores
            .len()
    };

    let (as_it_is, at_one_size) = (found(&[1.0]), tiles.swap(0, Relaxed));
    let (closer, at_both) = (found(&[2.0, 1.0]), tiles.swap(0, Relaxed));
    let everywhere = (found(&[2.0]), tiles.swap(0, Relaxed));
    assert!(2 * closer >= 3 * as_it_is, "{closer} {as_it_is}");
    assert!(10 * closer >= 9 * everywhere.0, "{closer} {everywhere:?}");
    assert!(
        at_both - at_one_size < everywhere.1 / 2,
        "{at_both} {everywhere:?}"
    );
}

/// A short-sighted detector that counts what it is shown.
struct Counting<'a>(&'a AtomicU32);

impl Detector for Counting<'_> {
    type Error = Infallible;

    fn detect(&self, image: &RgbImage, _: Option<&ReliefMap>) -> Result<Vec<Detection>, Infallible> {
        self.0.fetch_add(1, Relaxed);
        Shortsighted.detect(image, None)
    }
}
