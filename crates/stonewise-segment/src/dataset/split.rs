//! Stones to learn from, stones to measure on.

use crate::Sample;
use crate::seed::mix;
use std::collections::BTreeMap;

/// Square blocks of a photo, some of which are kept for measuring.
///
/// The split is one of blocks and not of photos, so that it works for a single photo too. A stone belongs to
/// the blocks that hold most of it; training crops that show a block kept for measuring carry no label of
/// it, so that no label is learnt and measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    block_px: u32,
    columns: u32,
    kept: Vec<bool>,
    is_kept_stone: BTreeMap<u32, bool>,
}

impl Split {
    /// Keeps about this share of the blocks that show stones, one at least where there are two.
    pub fn new(sample: &Sample, block_px: u32, share: f64, seed: u64) -> Self {
        let labels = sample.labels();
        let columns = labels.width().div_ceil(block_px);
        let blocks = (columns * labels.height().div_ceil(block_px)) as usize;
        let block = |index: usize| block_of(index, labels.width(), block_px, columns);
        let mut stone_pixels = vec![0u64; blocks];
        for (index, _) in labels.data().iter().enumerate().filter(|(_, l)| **l != 0) {
            stone_pixels[block(index)] += 1;
        }
        // Blocks with some stones in them, in an order by chance.
        let enough = u64::from(block_px).pow(2) / 4;
        let mut order: Vec<usize> = (0..blocks).filter(|&b| stone_pixels[b] >= enough).collect();
        order.sort_by_key(|&b| mix(seed, b as u64));
        let count = match order.len() {
            0 | 1 => 0,
            all => ((all as f64 * share).round() as usize).max(1),
        };
        let mut kept = vec![false; blocks];
        order.iter().take(count).for_each(|&b| kept[b] = true);
        let mut inside: BTreeMap<u32, [u64; 2]> = BTreeMap::new();
        for (index, &label) in labels.data().iter().enumerate().filter(|(_, l)| **l != 0) {
            inside.entry(label).or_default()[usize::from(kept[block(index)])] += 1;
        }
        Self {
            block_px,
            columns,
            kept,
            is_kept_stone: inside
                .into_iter()
                .map(|(l, [out, within])| (l, within > out))
                .collect(),
        }
    }

    /// First pixel (x, y) of every block kept for measuring.
    pub fn kept_blocks(&self) -> impl Iterator<Item = [u32; 2]> {
        let corner = |b: usize| [b as u32 % self.columns, b as u32 / self.columns].map(|i| i * self.block_px);
        self.kept
            .iter()
            .enumerate()
            .filter(|(_, kept)| **kept)
            .map(move |(b, _)| corner(b))
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
        Sample::from_pixels(width, height, |index| {
            let label = sample.labels().data()[index];
            let is_kept = match self.is_kept_stone.get(&label) {
                Some(&is_kept) => is_kept,
                None => self.kept[block_of(index, width, self.block_px, self.columns)],
            };
            let known = is_kept == to_kept;
            let label = if known { label } else { 0 };
            (
                sample.image().data()[index],
                label,
                sample.ignore().data()[index] || !known,
            )
        })
    }
}

fn block_of(index: usize, width: u32, block_px: u32, columns: u32) -> usize {
    let (x, y) = (index as u32 % width, index as u32 / width);
    (y / block_px * columns + x / block_px) as usize
}
