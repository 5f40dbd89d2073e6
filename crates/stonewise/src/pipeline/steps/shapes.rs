//! What one epoch without masks can take from the others: where their stones should be, and their shapes.

use crate::error::Result;
use crate::pipeline::steps::label::Labelled;
use crate::project::Project;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::sync::Arc;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::id::StoneId;
use stonewise_core::matching::MatchReport;
use stonewise_core::progress::Progress;
use stonewise_core::stone::{MatchOutcome, Stone, UnmatchedReason};
use stonewise_core::transfer::{StoneShape, stone_shapes};

/// Whether stones of an epoch are corrected by those of others: epochs with masks stay as they are.
pub fn is_corrected(project: &Project, epoch: EpochId) -> bool {
    project.settings.carry.enabled && project.epochs[epoch].masks.is_none()
}

/// Which stones of the first epoch and a later one match. Stones missing from the labels or from the report are left
/// out.
pub struct Matches<'a> {
    /// Stones of the first epoch, and how their surroundings moved to the later one.
    pub first: Vec<(&'a Stone, Vector3<f64>)>,
    /// Stones of the first epoch and of the later one that match, and how their surroundings moved.
    pub partners: Vec<(&'a Stone, &'a Stone, Vector3<f64>)>,
    /// Those of `first` without a partner although the later epoch shows their place.
    pub first_alone: Vec<(&'a Stone, Vector3<f64>)>,
    /// Stones of the later epoch without a partner.
    pub later_alone: Vec<&'a Stone>,
}

impl<'a> Matches<'a> {
    pub fn new(labelled: Pair<&'a Labelled>, report: &MatchReport) -> Self {
        let by_id = labelled.map(|l| l.stones.iter().map(|s| (s.id, s)).collect::<BTreeMap<_, _>>());
        let later_of = |id: &StoneId| by_id.later.get(id).copied();
        let mut matches = Self {
            first: Vec::new(),
            partners: Vec::new(),
            first_alone: Vec::new(),
            later_alone: report.unmatched_second.iter().filter_map(later_of).collect(),
        };
        for ((id, outcome), &shift) in report.outcomes.iter().zip(&report.local_shifts) {
            let Some(&stone) = by_id.first.get(id) else {
                continue;
            };
            matches.first.push((stone, shift));
            match outcome {
                MatchOutcome::Matched { second } => {
                    let partner = later_of(second);
                    matches
                        .partners
                        .extend(partner.map(|later| (stone, later, shift)));
                }
                MatchOutcome::Unmatched(UnmatchedReason::Unseen) => {}
                MatchOutcome::Unmatched(_) => matches.first_alone.push((stone, shift)),
            }
        }
        matches
    }

    /// How the surroundings of a stone of the later epoch moved from there to the first.
    pub fn shift_back(&self, stone: &Stone) -> Option<Vector3<f64>> {
        let apart =
            |(s, shift): &(&Stone, Vector3<f64>)| (s.centroid + *shift - stone.centroid).norm_squared();
        let nearest = self.first.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
        Some(-nearest.1)
    }
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
