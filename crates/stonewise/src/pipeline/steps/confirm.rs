//! Stones that one view shows and nothing confirms.
//!
//! The vote in one epoch keeps a stone that one of five views shows, because the detector misses stones. Where no other
//! epoch shows it better, it is not a stone: a stain, a part of a stone, or ground and shrubs beside the wall, which
//! the detector takes for the same stone in every epoch. Their surface is smooth, so that they seem to slide.

use super::carry::CARRY;
use super::label::{Labelled, Labels, tabulate};
use super::shapes::is_corrected;
use super::views::has_no_photos;
use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Need, Phase, Run, Step};
use crate::pipeline::until::Until;
use crate::project::Project;
use crate::storage::labels::DiskLabels;
use crate::storage::step::Key;
use std::collections::BTreeSet;
use std::sync::Arc;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::id::StoneId;
use stonewise_core::stone::{MatchOutcome, Stone};
use stonewise_core::transfer::drop_stones;

/// Drops stones of an epoch that one view shows and no other epoch shows better.
pub static CONFIRM: Step = Step {
    name: STEP,
    phase: Some(Phase::Find),
    about: About::Epoch,
    needs: &[Need::all(&CARRY)],
    wanted: |until| until >= Until::Labelled,
    applies: is_of_views,
    cost: Some(|sizes, _| Cost::of(1, sizes.every_pair_bytes())),
    make: |run, epoch| run.confirmed(epoch).map(drop),
    ..Step::PLAIN
};

const STEP: &str = "confirm";
/// The tiles whose labels changed.
const TILES: &str = "tiles.json";
/// Share of the votes on the points of a stone below which the views that see them speak against it.
const AGREED: f64 = 0.5;

/// Whether the stones of an epoch were found in views of its clouds.
fn is_of_views(project: &Project, epoch: EpochId) -> bool {
    is_corrected(project, epoch) && has_no_photos(project, epoch)
}

impl Run<'_> {
    /// An epoch without the stones that one view shows and no other epoch shows better.
    pub fn confirmed(&self, epoch: EpochId) -> Result<Arc<Labelled>> {
        let own = Arc::clone(&self.carried(epoch)?.labelled);
        if !is_of_views(self.context.project, epoch) {
            return Ok(own);
        }
        let confirmed = self.once(&CONFIRM, epoch, || {
            let mut alone: BTreeSet<StoneId> =
                own.stones.iter().filter(|s| is_weak(s)).map(|s| s.id).collect();
            let others: Vec<EpochId> = match epoch.is_reference() {
                true => self.context.project.epochs.later_ids().collect(),
                false => vec![EpochId::REFERENCE],
            };
            for other in others {
                if !alone.is_empty() {
                    let confirmed = confirmed_by(self, other, epoch)?;
                    alone.retain(|stone| !confirmed.contains(stone));
                }
            }
            without(self, epoch, &own, &alone)
        })?;
        Ok(Arc::clone(&*confirmed))
    }
}

/// Whether one view alone shows a stone, or none where it was carried from another epoch, and the others that see its
/// points speak against it.
fn is_weak(stone: &Stone) -> bool {
    stone.photos <= 1 && stone.confidence < AGREED
}

/// The stones of an epoch that another one shows, too, and well.
fn confirmed_by(run: &Run, other: EpochId, own: EpochId) -> Result<BTreeSet<StoneId>> {
    let later = if own.is_reference() { other } else { own };
    let pair = Pair::new(run.carried(EpochId::REFERENCE)?, run.carried(later)?);
    let report = run.matches("confirm-match", pair.each_ref().map(|c| &*c.labelled), later)?;
    let has_masks = run.context.project.epochs[other].masks.is_some();
    let stones = &run.carried(other)?.labelled.stones;
    let shown = stones.iter().filter(|s| has_masks || !is_weak(s)).map(|s| s.id);
    Ok(with_partners(
        &report.outcomes,
        &shown.collect(),
        own.is_reference(),
    ))
}

/// The stones whose partners are among `shown`: stones of the first epoch, or of the second.
fn with_partners(
    outcomes: &[(StoneId, MatchOutcome)],
    shown: &BTreeSet<StoneId>,
    are_first: bool,
) -> BTreeSet<StoneId> {
    let matched = outcomes.iter().filter_map(|(first, outcome)| match outcome {
        MatchOutcome::Matched { second } => Some((*first, *second)),
        MatchOutcome::Unmatched(_) => None,
    });
    let own_and_other = matched.map(|(first, second)| match are_first {
        true => (first, second),
        false => (second, first),
    });
    let confirmed = own_and_other.filter(|(_, other)| shown.contains(other));
    confirmed.map(|(own, _)| own).collect()
}

/// Drops these stones from an epoch.
fn without(
    run: &Run,
    epoch: EpochId,
    own: &Arc<Labelled>,
    stones: &BTreeSet<StoneId>,
) -> Result<Arc<Labelled>> {
    if stones.is_empty() {
        return Ok(Arc::clone(own));
    }
    let (context, tiles) = (run.context, &own.ingested.tiles.surveyed);
    let key = Key::new(STEP, stones, &[own.key.as_str()]);
    let step = context.step(&format!("{STEP}-{epoch}"), key, |step, _| {
        let mut target = DiskLabels::new(step.path(), tiles);
        let numbers = stones.iter().map(|s| s.0).collect();
        let changed = drop_stones(tiles, &own.store, &mut target, &numbers, context.progress)?;
        write_json(&step.file(TILES), &changed)
    })?;
    let changed: BTreeSet<usize> = read_json(&step.file(TILES))?;
    let (mut store, mut transfer) = (own.store.clone(), own.transfer.clone());
    store.replace(&changed, &DiskLabels::new(step.path(), tiles));

    transfer.stones.retain(|s| !stones.contains(&s.stone));
    let mut carried = own.carried.clone();
    carried.retain(|stone, _| !stones.contains(stone));
    let labels = Labels {
        transfer,
        store,
        step,
    };

    Ok(Arc::new(Labelled {
        carried,
        ..tabulate(run, epoch, "stones-confirmed", labels)?
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};
    use stonewise_core::stone::UnmatchedReason;

    #[test]
    fn a_second_view_a_view_that_sees_alone_or_a_well_shown_partner_confirm_a_stone() {
        let stone = |photos: u32, confidence: f64| Stone {
            id: StoneId(1),
            centroid: Point3::origin(),
            normal: Vector3::x(),
            area_m2: 0.02,
            points: 400,
            photos,
            confidence,
        };
        assert!(is_weak(&stone(1, 0.2)) && is_weak(&stone(0, 0.0)));
        assert!(!is_weak(&stone(2, 0.3)) && !is_weak(&stone(1, 0.9)));

        let [a, b, c] = [1, 2, 3].map(StoneId);
        let [x, y] = [11, 12].map(StoneId);
        let outcomes = [
            (a, MatchOutcome::Matched { second: x }),
            (b, MatchOutcome::Matched { second: y }),
            (c, MatchOutcome::Unmatched(UnmatchedReason::Lost)),
        ];
        assert_eq!(
            with_partners(&outcomes, &BTreeSet::from([x]), true),
            BTreeSet::from([a])
        );
        assert_eq!(
            with_partners(&outcomes, &BTreeSet::from([b, c]), false),
            BTreeSet::from([y])
        );
    }
}
