//! Stones that the detector missed in one epoch, from the epochs that show them.
//!
//! A stone that is not detected is not necessarily gone: the detector misses one stone in seven. A stone of
//! one epoch without a partner in another is therefore looked for in the other's cloud, where its neighbours
//! predict it. This step comes after the vote of the photos and before edits by hand, which can overrule it.
//! Epochs with masks stay as they are.

use super::join::JOIN;
use super::label::{DiskLabels, Labelled, Labels, last_number, tabulate};
use super::shapes::{Others, is_corrected, shapes, shift_back};
use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Need, Run, Step};
use crate::pipeline::until::Until;
use crate::storage::step::Key;
use nalgebra::{Point3, Vector3};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::geometry::View;
use stonewise_core::id::StoneId;
use stonewise_core::matching::MatchReport;
use stonewise_core::stone::{MatchOutcome, Stone, UnmatchedReason};
use stonewise_core::transfer::{
    CarriedStone, CarryReport, NotCarried, PlacedShape, StoneInstances, carry_labels, photos_facing,
};

/// Looks for stones that one epoch shows and another does not: those of later epochs in the reference, then
/// those of the reference in the later ones.
pub static CARRY: Step = Step {
    name: "carry",
    words: |_| "missed stones looked for in",
    about: About::Epoch,
    needs: &[Need::all(&JOIN), Need::reference(&CARRY)],
    wanted: |until| until >= Until::Labelled,
    applies: is_corrected,
    cost: Some(|sizes, _| Cost::of(2, sizes.every_pair_bytes())),
    make: |run, epoch| run.carried(epoch).map(drop),
    ..Step::PLAIN
};

/// A stone that was looked for in an epoch.
#[derive(Clone)]
pub struct CarryAttempt {
    /// The epoch in which it was looked for.
    pub epoch: EpochId,
    /// The epoch that shows it.
    pub from: EpochId,
    /// Its number there.
    pub stone: StoneId,
    /// Photos of the epoch that shows it, which do.
    pub photos: u32,
    /// Photos of both epochs that face its place and do not show it.
    pub missed: u32,
    /// What became of it.
    pub outcome: Outcome,
}

/// What the step says about the stones that it looked for.
const REPORT: &str = "report.json";

/// An epoch with the stones that were carried into it.
pub struct Carried {
    /// Its labels.
    pub labelled: Arc<Labelled>,
    /// The stones that were looked for; empty where there are none.
    pub attempts: Vec<CarryAttempt>,
    /// Whether any was found.
    is_changed: bool,
}

impl Run<'_> {
    /// An epoch with the stones that others show.
    pub fn carried(&self, epoch: EpochId) -> Result<Arc<Carried>> {
        if !is_corrected(self.context.project, epoch) {
            return Ok(Arc::new(Carried::unchanged(&self.joined(epoch)?.labelled)));
        }
        self.once(&CARRY, epoch, || match epoch.is_reference() {
            true => into_reference(self),
            false => into_later(self, epoch),
        })
    }
}

impl Carried {
    fn unchanged(labelled: &Arc<Labelled>) -> Self {
        Self {
            labelled: Arc::clone(labelled),
            attempts: Vec::new(),
            is_changed: false,
        }
    }
}

fn into_reference(run: &Run) -> Result<Carried> {
    let first = &run.joined(EpochId::REFERENCE)?.labelled;
    let (mut wishes, mut others) = (Vec::new(), Others::new());
    for later in run.context.project.epochs.later_ids() {
        let labelled = Arc::clone(&run.joined(later)?.labelled);
        let report = run.matches("carry-match", Pair::new(first, &labelled), later)?;
        wishes.extend(backwards(run, Pair::new(first, &labelled), later, &report)?);
        others.insert(later, labelled);
    }
    carry_into(run, EpochId::REFERENCE, first, &others, wishes)
}

fn into_later(run: &Run, later: EpochId) -> Result<Carried> {
    let (first, labelled) = (run.carried(EpochId::REFERENCE)?, &run.joined(later)?.labelled);
    // Stones that came from another later epoch have no partner in this one yet.
    let report = match first.is_changed && run.context.project.epochs.len() > 2 {
        true => run.matches("carry-match-again", Pair::new(&first.labelled, labelled), later)?,
        false => {
            let before = run.joined(EpochId::REFERENCE)?;
            run.matches("carry-match", Pair::new(&before.labelled, labelled), later)?
        }
    };
    let wishes = forwards(run, &first.labelled, later, &report)?;
    let others = Others::from([(EpochId::REFERENCE, Arc::clone(&first.labelled))]);
    carry_into(run, later, labelled, &others, wishes)
}

/// A stone that is to be looked for in another epoch.
#[derive(Clone, Debug, Serialize)]
struct Wish {
    /// The epoch that shows it.
    from: EpochId,
    stone: StoneId,
    outward: Vector3<f64>,
    /// How its surroundings moved from that epoch to the other.
    shift: Vector3<f64>,
    photos: u32,
    missed: u32,
}

impl Wish {
    /// `from`: the epoch that shows the stone; `to`: the other. None where the views of the other show the place
    /// nowhere, because it lies before the wall.
    fn new(run: &Run, stone: &Stone, [from, to]: [EpochId; 2], shift: Vector3<f64>) -> Result<Option<Self>> {
        let steepest = run.context.project.settings.label.max_incidence_rad;
        let facing = |epoch: EpochId, place: &Point3<f64>| {
            let views = &run.posed(epoch)?.views;
            Result::Ok(photos_facing(views, place, &stone.normal, steepest) as u32)
        };
        let place = stone.centroid + shift;
        let facing = [facing(from, &stone.centroid)?, facing(to, &place)?];
        let leaves_out = |view: &View| {
            view.camera
                .near
                .is_some_and(|near| near.hides(&(view.cam_from_world * place)))
        };
        if facing[1] == 0 && run.posed(to)?.views.iter().any(leaves_out) {
            return Ok(None);
        }
        Ok(Some(Self {
            from,
            stone: stone.id,
            outward: stone.normal,
            shift,
            photos: stone.photos,
            missed: facing[0].saturating_sub(stone.photos) + facing[1],
        }))
    }

    /// Whether the photos of both epochs together accept the stone, by the rule of the vote in one epoch.
    fn is_elected(&self, missed_weight: f64) -> bool {
        f64::from(self.photos) >= missed_weight * f64::from(self.missed)
    }
}

/// Stones of the reference without a partner in a later epoch that shows their place.
fn forwards(run: &Run, first: &Labelled, later: EpochId, report: &MatchReport) -> Result<Vec<Wish>> {
    let stones: BTreeMap<StoneId, &Stone> = first.stones.iter().map(|s| (s.id, s)).collect();
    let missing = report.outcomes.iter().zip(&report.local_shifts).filter(|((_, outcome), _)| {
        matches!(outcome, MatchOutcome::Unmatched(reason) if *reason != UnmatchedReason::Unseen)
    });
    missing
        .filter_map(|((id, _), shift)| Some((*stones.get(id)?, shift)))
        .filter_map(|(stone, shift)| Wish::new(run, stone, [EpochId::REFERENCE, later], *shift).transpose())
        .collect()
}

/// Stones of a later epoch without a partner in the reference.
fn backwards(
    run: &Run,
    labelled: Pair<&Labelled>,
    later: EpochId,
    report: &MatchReport,
) -> Result<Vec<Wish>> {
    let stones = labelled.map(|l| &l.stones);
    let is_missing = |s: &&Stone| report.unmatched_second.binary_search(&s.id).is_ok();
    let missing = stones.later.iter().filter(is_missing);
    missing
        .filter_map(|stone| Some((stone, shift_back(stones.first, report, stone)?)))
        .filter_map(|(stone, shift)| Wish::new(run, stone, [later, EpochId::REFERENCE], shift).transpose())
        .collect()
}

/// Looks for stones of other epochs in one.
fn carry_into(
    run: &Run,
    epoch: EpochId,
    own: &Arc<Labelled>,
    others: &Others,
    wishes: Vec<Wish>,
) -> Result<Carried> {
    if wishes.is_empty() {
        return Ok(Carried::unchanged(own));
    }
    let (context, settings) = (run.context, &run.context.project.settings);
    let sources: BTreeSet<EpochId> = wishes.iter().map(|w| w.from).collect();
    let mut keys = vec![own.key.as_str()];
    keys.extend(
        sources
            .iter()
            .filter_map(|from| Some(others.get(from)?.key.as_str())),
    );
    let params = (
        &settings.carry,
        settings.label.missed_weight,
        settings.label.min_points,
    );

    let key = Key::new("carry", &(params, &wishes), &keys);
    let step = context.step(&format!("carry-{epoch}"), key, |step, _| {
        let mut target = DiskLabels::new(step.path(), &own.ingested.tiles.surveyed);
        let report = look_for(context, own, others, &wishes, &mut target)?;
        write_json(&step.file(REPORT), &report)
    })?;
    let report: CarryReport = read_json(&step.file(REPORT))?;

    let attempt = |(wish, outcome): (&Wish, &Outcome)| CarryAttempt {
        epoch,
        from: wish.from,
        stone: wish.stone,
        photos: wish.photos,
        missed: wish.missed,
        outcome: outcome.clone(),
    };

    let attempts = wishes.iter().zip(&report.outcomes).map(attempt).collect();
    if report.tiles.is_empty() {
        return Ok(Carried {
            attempts,
            ..Carried::unchanged(own)
        });
    }

    let (mut store, mut transfer) = (own.store.clone(), own.transfer.clone());
    store.replace(
        &report.tiles,
        &DiskLabels::new(step.path(), &own.ingested.tiles.surveyed),
    );
    let mut carried = own.carried.clone();

    for (wish, found) in wishes.iter().zip(&report.outcomes) {
        if let Ok(found) = found {
            let stone = StoneId(found.stone);
            carried.insert(stone, wish.from);
            let instances = Vec::new();
            transfer.stones.push(StoneInstances { stone, instances });
        }
    }

    let labels = Labels {
        transfer,
        store,
        step,
    };
    let tabulated = tabulate(run, epoch, "stones-carried", labels)?;

    Ok(Carried {
        labelled: Arc::new(Labelled { carried, ..tabulated }),
        attempts,
        is_changed: true,
    })
}

/// What became of a stone.
type Outcome = std::result::Result<CarriedStone, NotCarried>;

/// Finds the points of stones of other epochs in one, and labels them in `target`.
fn look_for(
    context: &Context,
    own: &Labelled,
    others: &Others,
    wishes: &[Wish],
    target: &mut DiskLabels,
) -> Result<CarryReport> {
    let settings = &context.project.settings;
    let is_elected = |wish: &&Wish| wish.is_elected(settings.label.missed_weight);
    let elected = wishes.iter().filter(is_elected);
    let elected = elected.map(|w| (w.from, w.stone, w.outward));
    let shapes = shapes(others, elected, context.progress)?;
    let placed = wishes.iter().filter_map(|wish| {
        let shape = shapes.get(&(wish.from, wish.stone))?;
        let shift = wish.shift;
        Some(PlacedShape { shape, shift })
    });
    let found = carry_labels(
        &own.ingested.tiles,
        &own.store,
        target,
        &placed.collect::<Vec<_>>(),
        [last_number(own) + 1, settings.label.min_points],
        &settings.carry,
        context.progress,
    )?;

    let mut of_placed = found.outcomes.into_iter().peekable();
    let mut outcome = |wish: &Wish| {
        let is_placed = shapes.contains_key(&(wish.from, wish.stone));
        match of_placed.next_if(|_| is_placed) {
            Some(outcome) => outcome,
            None if is_elected(&wish) => Err(NotCarried::NoShape),
            None => Err(NotCarried::Outvoted {
                photos: wish.photos,
                missed: wish.missed,
            }),
        }
    };

    Ok(CarryReport {
        outcomes: wishes.iter().map(&mut outcome).collect(),
        tiles: found.tiles,
    })
}
