//! Stones to learn from, stones to measure on.

use crate::Sample;
use crate::seed::mix;
use std::collections::{BTreeMap, BTreeSet};

/// Square blocks of a photo, some of which are kept for measuring.
///
/// The split is one of blocks and not of photos, so that it works for a single photo too. A stone belongs to
/// the blocks that hold most of it; training crops that show a block kept for measuring carry no label of
/// it, so that no label is learnt and measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    blocks: Blocks,
    kept: Vec<bool>,
    is_kept_stone: BTreeMap<u32, bool>,
}

impl Split {
    /// Keeps about this share of the blocks that show stones, one at least where there are two.
    pub fn new(sample: &Sample, block_px: u32, share: f64, seed: u64) -> Self {
        let blocks = Blocks::of(sample, block_px);
        // Blocks with some stones in them, in an order by chance.
        let enough = u64::from(block_px).pow(2) / 4;
        let pixels = blocks.pixels(sample, |label| label != 0);
        let mut order: Vec<usize> = (0..blocks.count).filter(|&b| pixels[b] >= enough).collect();
        order.sort_by_key(|&b| mix(seed, b as u64));
        let count = match order.len() {
            0 | 1 => 0,
            all => ((all as f64 * share).round() as usize).max(1),
        };
        let mut kept = vec![false; blocks.count];
        order.iter().take(count).for_each(|&b| kept[b] = true);
        let mut inside: BTreeMap<u32, [u64; 2]> = BTreeMap::new();
        for (index, &label) in sample
            .labels()
            .data()
            .iter()
            .enumerate()
            .filter(|(_, l)| **l != 0)
        {
            inside.entry(label).or_default()[usize::from(kept[blocks.block(index)])] += 1;
        }
        let is_kept = |(label, [out, within]): (u32, [u64; 2])| (label, within > out);
        Self {
            blocks,
            kept,
            is_kept_stone: inside.into_iter().map(is_kept).collect(),
        }
    }

    /// Keeps these stones, and the blocks in which most pixels of stones are theirs.
    pub fn of_stones(sample: &Sample, block_px: u32, stones: &BTreeSet<u32>) -> Self {
        let blocks = Blocks::of(sample, block_px);
        let pixels = blocks.pixels(sample, |label| label != 0);
        let theirs = blocks.pixels(sample, |label| stones.contains(&label));
        let labels: BTreeSet<u32> = sample
            .labels()
            .data()
            .iter()
            .copied()
            .filter(|&l| l != 0)
            .collect();
        Self {
            kept: pixels
                .iter()
                .zip(theirs)
                .map(|(&all, theirs)| 2 * theirs > all)
                .collect(),
            blocks,
            is_kept_stone: labels.into_iter().map(|l| (l, stones.contains(&l))).collect(),
        }
    }

    /// First pixel (x, y) of every block kept for measuring.
    pub fn kept_blocks(&self) -> impl Iterator<Item = [u32; 2]> {
        let columns = self.blocks.columns;
        let corner = move |b: usize| [b as u32 % columns, b as u32 / columns];
        let side = self.blocks.side_px;
        self.kept
            .iter()
            .enumerate()
            .filter(|(_, kept)| **kept)
            .map(move |(b, _)| corner(b).map(|i| i * side))
    }

    /// The photo with nothing known but what is to be learnt.
    pub fn for_training(&self, sample: &Sample) -> Sample {
        self.restricted(sample, false)
    }

    /// The photo with nothing known but what is to be measured on.
    pub fn for_validation(&self, sample: &Sample) -> Sample {
        self.restricted(sample, true)
    }

    fn restricted(&self, sample: &Sample, to_kept: bool) -> Sample {
        let (width, height) = (sample.labels().width(), sample.labels().height());
        let restricted = Sample::from_pixels(width, height, |index| {
            let label = sample.labels().data()[index];
            let is_kept = match self.is_kept_stone.get(&label) {
                Some(&is_kept) => is_kept,
                None => self.kept[self.blocks.block(index)],
            };
            let known = is_kept == to_kept;
            let label = if known { label } else { 0 };
            (
                sample.image().data()[index],
                label,
                sample.ignore().data()[index] || !known,
            )
        });
        restricted.with_relief(sample.relief().cloned())
    }
}

/// The blocks of a photo, row by row.
#[derive(Clone, Debug, PartialEq)]
struct Blocks {
    side_px: u32,
    width: u32,
    columns: u32,
    count: usize,
}

impl Blocks {
    fn of(sample: &Sample, side_px: u32) -> Self {
        let (width, height) = (sample.labels().width(), sample.labels().height());
        let columns = width.div_ceil(side_px);
        Self {
            side_px,
            width,
            columns,
            count: (columns * height.div_ceil(side_px)) as usize,
        }
    }

    /// The block of a pixel, by its row-major index.
    fn block(&self, index: usize) -> usize {
        let (x, y) = (index as u32 % self.width, index as u32 / self.width);
        (y / self.side_px * self.columns + x / self.side_px) as usize
    }

    /// Pixels of each block whose label is wanted.
    fn pixels(&self, sample: &Sample, is_wanted: impl Fn(u32) -> bool) -> Vec<u64> {
        let mut pixels = vec![0; self.count];
        let wanted = sample
            .labels()
            .data()
            .iter()
            .enumerate()
            .filter(|(_, l)| is_wanted(**l));
        wanted.for_each(|(index, _)| pixels[self.block(index)] += 1);
        pixels
    }
}
