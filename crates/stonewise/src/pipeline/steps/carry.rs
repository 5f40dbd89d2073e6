//! Stones that the detector missed in one epoch, from the epochs that show them.
//!
//! A stone that is not detected is not necessarily gone: the detector misses one stone in seven. A stone of
//! one epoch without a partner in another is therefore looked for in the other's cloud, where its neighbours
//! predict it. This step comes after the vote of the photos and before edits by hand, which can overrule it.
//! Epochs with masks stay as they are.

use super::label::{DiskLabels, Labelled, Labels, last_number, tabulate};
use super::r#match::match_in;
use super::register::Registered;
use super::segment::Segmented;
use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::storage::step::Key;
use nalgebra::Vector3;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::id::StoneId;
use stonewise_core::matching::MatchReport;
use stonewise_core::stone::{MatchOutcome, MotionFailure, Stone, UnmatchedReason};
use stonewise_core::transfer::{
    CarriedStone, CarryReport, NotCarried, PlacedShape, StoneInstances, StoneShape, carry_labels,
    photos_facing, stone_shapes,
};

/// A stone that was looked for in an epoch.
pub struct CarryAttempt {
    /// The epoch in which it was looked for, from 1.
    pub epoch: usize,
    /// The epoch that shows it, from 1.
    pub from: usize,
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

/// Looks for stones that one epoch shows and another does not: those of later epochs in the first, then those
/// of the first in the later ones. The attempts are empty where there are none, or where all epochs have
/// masks.
pub fn carry(
    context: &Context,
    photos: &[Segmented],
    mut labelled: Vec<Labelled>,
) -> Result<(Vec<Labelled>, Vec<CarryAttempt>)> {
    let epochs = &context.project.epochs;
    let mut attempts = Vec::new();
    if !context.project.settings.carry.enabled || epochs.iter().all(|e| e.masks.is_some()) {
        return Ok((labelled, attempts));
    }
    let report = |labelled: &[Labelled], number: usize, name: &str| {
        let name = format!("{name}-{number}");
        match_in(context, &name, &labelled[0], &labelled[number - 1])
    };
    let mut matched = Vec::new();
    for number in 2..=labelled.len() {
        matched.push(report(&labelled, number, "carry-match")?);
    }
    let mut wishes = Vec::new();
    for (number, report) in (2..).zip(&matched) {
        wishes.extend(backwards(context, photos, &labelled, number, report));
    }
    let is_changed = carry_into(context, 1, photos, &mut labelled, wishes, &mut attempts)?;
    for number in 2..=labelled.len() {
        // Stones that came from another later epoch have no partner in this one yet.
        let again = match is_changed && labelled.len() > 2 {
            true => Some(report(&labelled, number, "carry-again")?),
            false => None,
        };
        let report = again.as_ref().unwrap_or(&matched[number - 2]);
        let wishes = forwards(context, photos, &labelled, number, report);
        carry_into(context, number, photos, &mut labelled, wishes, &mut attempts)?;
    }
    Ok((labelled, attempts))
}

/// A stone that is to be looked for in another epoch.
#[derive(Clone, Debug, Serialize)]
struct Wish {
    /// The epoch that shows it, from 1.
    from: usize,
    stone: StoneId,
    outward: Vector3<f64>,
    /// How its surroundings moved from that epoch to the other.
    shift: Vector3<f64>,
    photos: u32,
    missed: u32,
}

impl Wish {
    fn new(
        photos: &[Segmented],
        stone: &Stone,
        [from, to]: [usize; 2],
        shift: Vector3<f64>,
        steepest: f64,
    ) -> Self {
        let facing = |epoch: usize, shift: Vector3<f64>| {
            let place = stone.centroid + shift;
            photos_facing(&photos[epoch - 1].views, &place, &stone.normal, steepest) as u32
        };
        let facing = [facing(from, Vector3::zeros()), facing(to, shift)];
        Self {
            from,
            stone: stone.id,
            outward: stone.normal,
            shift,
            photos: stone.photos,
            missed: facing[0].saturating_sub(stone.photos) + facing[1],
        }
    }

    /// Whether the photos of both epochs together accept the stone, by the rule of the vote in one epoch.
    fn is_elected(&self, missed_weight: f64) -> bool {
        f64::from(self.photos) >= missed_weight * f64::from(self.missed)
    }
}

/// Stones of the first epoch without a partner in a later one that shows their place.
fn forwards(
    context: &Context,
    photos: &[Segmented],
    labelled: &[Labelled],
    number: usize,
    report: &MatchReport,
) -> Vec<Wish> {
    let steepest = context.project.settings.label.max_incidence_rad;
    let stones = labelled[0].stones.iter().map(|s| (s.id, s));
    let stones: BTreeMap<StoneId, &Stone> = stones.collect();
    let missing = report.outcomes.iter().zip(&report.local_shifts).filter(|((_, outcome), _)| {
        matches!(outcome, MatchOutcome::Unmatched(reason) if *reason != UnmatchedReason::Unseen)
    });
    missing
        .filter_map(|((id, _), shift)| {
            Some(Wish::new(photos, stones.get(id)?, [1, number], *shift, steepest))
        })
        .collect()
}

/// Stones of a later epoch without a partner in the first.
fn backwards(
    context: &Context,
    photos: &[Segmented],
    labelled: &[Labelled],
    number: usize,
    report: &MatchReport,
) -> Vec<Wish> {
    let steepest = context.project.settings.label.max_incidence_rad;
    let (first, later) = (&labelled[0].stones, &labelled[number - 1].stones);
    let is_missing = |s: &&Stone| report.unmatched_second.binary_search(&s.id).is_ok();
    let wish = |s: &Stone| {
        let shift = shift_back(first, report, s)?;
        Some(Wish::new(photos, s, [number, 1], shift, steepest))
    };
    later.iter().filter(is_missing).filter_map(wish).collect()
}

/// How the surroundings of a stone of a later epoch moved from there to the first.
pub(super) fn shift_back(first: &[Stone], report: &MatchReport, stone: &Stone) -> Option<Vector3<f64>> {
    let apart = |(s, shift): &(&Stone, &Vector3<f64>)| (s.centroid + *shift - stone.centroid).norm_squared();
    let places = first.iter().zip(&report.local_shifts);
    let nearest = places.min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
    Some(-nearest.1)
}

/// Looks for stones of other epochs in one; whether any was found.
fn carry_into(
    context: &Context,
    number: usize,
    photos: &[Segmented],
    labelled: &mut Vec<Labelled>,
    wishes: Vec<Wish>,
    attempts: &mut Vec<CarryAttempt>,
) -> Result<bool> {
    if wishes.is_empty() || context.project.epochs[number - 1].masks.is_some() {
        return Ok(false);
    }
    let settings = &context.project.settings;
    let sources: BTreeSet<usize> = wishes.iter().map(|w| w.from).collect();
    let mut keys = vec![labelled[number - 1].key.as_str()];
    keys.extend(sources.iter().map(|&from| labelled[from - 1].key.as_str()));
    let params = (
        &settings.carry,
        settings.label.missed_weight,
        settings.label.min_points,
    );
    let key = Key::new("carry", &(params, &wishes), &keys);
    let step = context.step(&format!("carry-{number}"), key, |step, _| {
        let mut target = DiskLabels::new(step.path(), &labelled[number - 1].ingested.tiles.surveyed);
        let report = look_for(context, number, labelled, &wishes, &mut target)?;
        write_json(&step.file(REPORT), &report)
    })?;
    let report: CarryReport = read_json(&step.file(REPORT))?;
    let attempt = |(wish, outcome): (&Wish, &Outcome)| CarryAttempt {
        epoch: number,
        from: wish.from,
        stone: wish.stone,
        photos: wish.photos,
        missed: wish.missed,
        outcome: outcome.clone(),
    };
    attempts.extend(wishes.iter().zip(&report.outcomes).map(attempt));
    if report.tiles.is_empty() {
        return Ok(false);
    }
    let Labelled {
        ingested,
        mut transfer,
        mut store,
        mut carried,
        ..
    } = labelled.remove(number - 1);
    store.replace(
        &report.tiles,
        &DiskLabels::new(step.path(), &ingested.tiles.surveyed),
    );
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
    let tabulated = tabulate(
        context,
        number,
        "stones-carried",
        &photos[number - 1],
        ingested,
        labels,
    )?;
    labelled.insert(number - 1, Labelled { carried, ..tabulated });
    Ok(true)
}

/// Removes the motions of carried stones that moved against their neighbours by more than
/// [`CarryParams::max_height_m`](stonewise_core::transfer::CarryParams::max_height_m). A stone was looked for
/// where its neighbours predict it; if it seems to be farther away, its points belong to something else.
pub fn drop_contradictions(context: &Context, [first, second]: [&Labelled; 2], registered: &mut Registered) {
    let limit_m = context.project.settings.carry.max_height_m;
    let mut dropped = BTreeSet::new();
    for pair in &mut registered.results {
        let is_carried = first.carried.contains_key(&pair.first) || second.carried.contains_key(&pair.second);
        if is_carried && pair.motion.as_ref().is_ok_and(|m| m.relative.norm() > limit_m) {
            pair.motion = Err(MotionFailure::Disagreement);
            dropped.insert(pair.first);
        }
    }
    let is_measured = |stone: &StoneId| !dropped.contains(stone);
    registered
        .neighbours
        .retain(|pair| pair.stones.iter().all(is_measured));
}

/// What became of a stone.
type Outcome = std::result::Result<CarriedStone, NotCarried>;

/// Finds the points of stones of other epochs in one, and labels them in `target`.
fn look_for(
    context: &Context,
    number: usize,
    labelled: &[Labelled],
    wishes: &[Wish],
    target: &mut DiskLabels,
) -> Result<CarryReport> {
    let settings = &context.project.settings;
    let is_elected = |wish: &&Wish| wish.is_elected(settings.label.missed_weight);
    let elected = wishes.iter().filter(is_elected);
    let shapes = shapes(context, labelled, elected.map(|w| (w.from, w.stone, w.outward)))?;
    let placed = wishes.iter().filter_map(|wish| {
        let shape = shapes.get(&(wish.from, wish.stone))?;
        let shift = wish.shift;
        Some(PlacedShape { shape, shift })
    });
    let own = &labelled[number - 1];
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

/// Shapes of stones; `asked`: the epoch that shows each, from 1, its number, and the outward normal of its
/// face.
pub(super) fn shapes(
    context: &Context,
    labelled: &[Labelled],
    asked: impl Iterator<Item = (usize, StoneId, Vector3<f64>)>,
) -> Result<BTreeMap<(usize, StoneId), StoneShape>> {
    let mut wanted: BTreeMap<usize, BTreeMap<StoneId, Vector3<f64>>> = BTreeMap::new();
    for (from, stone, outward) in asked {
        wanted.entry(from).or_default().insert(stone, outward);
    }
    let mut shapes = BTreeMap::new();
    for (from, stones) in wanted {
        let Labelled { ingested, store, .. } = &labelled[from - 1];
        let found = stone_shapes(&ingested.tiles, store, &stones, context.progress)?;
        shapes.extend(found.into_iter().map(|(stone, shape)| ((from, stone), shape)));
    }
    Ok(shapes)
}
