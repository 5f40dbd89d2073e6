//! What several sections say of the two epochs.

use stonewise_results::ResultSet;
use stonewise_results::records::RunRecord;

/// Names of the first and of the compared epoch, as far as run.json has them.
pub(super) fn epoch_names(run: &RunRecord, pair: usize) -> Option<[String; 2]> {
    let name = |epoch: usize| Some(run.epochs.get(epoch)?.name.clone());
    Some([name(0)?, name(pair)?])
}

/// In-plane part of a known translation of the compared epoch, millimetres, where run.json names one.
pub(super) fn known_translation_mm(results: &ResultSet) -> Option<[f64; 2]> {
    let epoch = results.run.as_ref()?.epochs.get(results.pair)?;
    let d = epoch.motion.as_ref()?.common_displacement()?;
    let stone = results.stones.get(results.stones.len() / 2)?;
    let frame = results.facade.frame_at(&stone.centroid);
    Some([d.dot(&frame.along) * 1e3, d.dot(&frame.up) * 1e3])
}
