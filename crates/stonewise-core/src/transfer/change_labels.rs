//! Labels of tiles, changed one tile after the other.

use super::{LabelStore, TileLabels, TransferError};
use crate::progress::Progress;
use std::collections::BTreeSet;

/// Changes the labels of these tiles; `what`: the work, for those who wait. `change` is called for each tile and
/// returns whether it changed the labels; changed labels are written to `target`. Returns the tiles that changed.
///
/// # Errors
/// Labels of a tile cannot be read or written, interruption.
pub(super) fn change_labels<S: LabelStore>(
    labels: &S,
    target: &mut S,
    tiles: impl IntoIterator<Item = usize>,
    (what, progress): (&str, &dyn Progress),
    mut change: impl FnMut(usize, &mut TileLabels) -> bool,
) -> Result<BTreeSet<usize>, TransferError> {
    let mut changed = BTreeSet::new();
    let tiles: Vec<usize> = tiles.into_iter().collect();
    progress.each(what, tiles, |tile| -> Result<(), TransferError> {
        let mut table = labels.read(tile).map_err(|e| TransferError::labels(tile, e))?;
        if change(tile, &mut table) {
            target
                .write(tile, &table)
                .map_err(|e| TransferError::labels(tile, e))?;
            changed.insert(tile);
        }
        Ok(())
    })?;
    Ok(changed)
}
