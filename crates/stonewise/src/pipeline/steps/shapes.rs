//! What one epoch without masks can take from the others: where their stones should be, and their shapes.

use crate::error::Result;
use crate::pipeline::steps::label::Labelled;
use crate::project::Project;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::id::StoneId;
use stonewise_core::matching::MatchReport;
use stonewise_core::progress::Progress;
use stonewise_core::stone::Stone;
use stonewise_core::transfer::{StoneShape, stone_shapes};

/// Whether stones of an epoch are corrected by those of others: epochs with masks stay as they are.
pub fn is_corrected(project: &Project, epoch: EpochId) -> bool {
    project.settings.carry.enabled && project.epochs[epoch].masks.is_none()
}

/// How the surroundings of a stone of a later epoch moved from there to the first.
pub fn shift_back(first: &[Stone], report: &MatchReport, stone: &Stone) -> Option<Vector3<f64>> {
    let apart = |(s, shift): &(&Stone, &Vector3<f64>)| (s.centroid + *shift - stone.centroid).norm_squared();
    let places = first.iter().zip(&report.local_shifts);
    let nearest = places.min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
    Some(-nearest.1)
}

/// Labels of other epochs.
pub type Others = BTreeMap<EpochId, Arc<Labelled>>;

/// Shapes of stones; `asked`: the epoch that shows each, its number, and the outward normal of its face.
pub fn shapes(
    others: &Others,
    asked: impl Iterator<Item = (EpochId, StoneId, Vector3<f64>)>,
    progress: &dyn Progress,
) -> Result<BTreeMap<(EpochId, StoneId), StoneShape>> {
    let mut wanted: BTreeMap<EpochId, BTreeMap<StoneId, Vector3<f64>>> = BTreeMap::new();
    for (from, stone, outward) in asked {
        wanted.entry(from).or_default().insert(stone, outward);
    }
    let mut shapes = BTreeMap::new();
    for (from, stones) in wanted {
        let Some(labelled) = others.get(&from) else {
            continue;
        };
        let found = stone_shapes(&labelled.ingested.tiles, &labelled.store, &stones, progress)?;
        shapes.extend(found.into_iter().map(|(stone, shape)| ((from, stone), shape)));
    }
    Ok(shapes)
}
