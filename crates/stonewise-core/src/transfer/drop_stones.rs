//! Stones that turned out to be none.

use super::change_labels::change_labels;
use super::{LabelStore, TransferError};
use crate::cloud::TileSource;
use crate::progress::Progress;
use std::collections::BTreeSet;

/// Takes the labels of these stones off all points; labels of tiles that change go to `target`. Which tiles these are.
///
/// Cost: one pass over the labels.
///
/// # Errors
/// Labels of a tile cannot be read or written, interruption.
pub fn drop_stones<T: TileSource, S: LabelStore>(
    tiles: &T,
    labels: &S,
    target: &mut S,
    stones: &BTreeSet<u32>,
    progress: &dyn Progress,
) -> Result<BTreeSet<usize>, TransferError> {
    let every = 0..tiles.tile_count();
    let progress = ("stones that are none", progress);
    change_labels(labels, target, every, progress, |_, table| {
        let mut is_changed = false;
        for stone in table.stone.iter_mut().filter(|stone| stones.contains(stone)) {
            *stone = 0;
            is_changed = true;
        }
        is_changed
    })
}

#[cfg(test)]
mod tests {
    use super::super::{MemoryLabels, TileLabels};
    use super::*;
    use crate::cloud::{Cloud, MemoryTiles};
    use crate::progress::Silent;
    use nalgebra::Point3;

    #[test]
    fn only_tiles_that_hold_a_dropped_stone_are_written() {
        let cloud = || Cloud::from_world(Point3::origin(), vec![Point3::origin(); 3]);
        let tiles = MemoryTiles::new(vec![cloud(), cloud(), cloud()]);
        let labels = |stone: [u32; 3]| TileLabels {
            stone: stone.to_vec(),
            confidence: vec![0.5; 3],
            seen: vec![true; 3],
        };
        let store = MemoryLabels {
            tiles: vec![labels([4, 0, 5]), labels([5, 7, 4]), labels([4, 4, 0])],
        };
        let mut target = MemoryLabels::default();
        let changed = drop_stones(&tiles, &store, &mut target, &BTreeSet::from([7, 9]), &Silent).unwrap();
        assert_eq!(changed, BTreeSet::from([1]));
        assert_eq!(target.tiles, [TileLabels::default(), labels([5, 0, 4])]);
    }
}
