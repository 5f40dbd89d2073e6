//! The tiles of a cloud with their labels, one after the other.

use super::{LabelStore, TileLabels, TransferError};
use crate::cloud::{Cloud, TileSource};
use crate::progress::Progress;

/// Visits every tile with its number, its points and their labels; `what`: the work, for those who wait.
///
/// # Errors
/// A tile or its labels cannot be read or do not fit together, interruption.
pub(super) fn each_tile<T: TileSource, S: LabelStore>(
    tiles: &T,
    store: &S,
    what: &str,
    progress: &dyn Progress,
    mut visit: impl FnMut(usize, &Cloud, &TileLabels),
) -> Result<(), TransferError> {
    let load = |tile| {
        let labels = store.read(tile).map_err(|e| TransferError::labels(tile, e))?;
        let cloud = tiles.load(tile).map_err(|e| TransferError::tile(tile, e))?;
        let count = labels.stone.len().min(labels.confidence.len());
        if count != cloud.len() {
            return Err(TransferError::LabelCount {
                tile,
                points: cloud.len(),
                labels: count,
            });
        }
        Ok((cloud, labels))
    };
    progress.each_prepared(what, 0..tiles.tile_count(), load, |tile, (cloud, labels)| {
        visit(tile, &cloud, &labels);
        Ok(())
    })
}
