//! Stones that the detector divided in one epoch, from the epochs that show them whole.
//!
//! The photos of an epoch agree on what they show, but a stain or a shadow can divide a stone in most of
//! them. Photos of another epoch, in another light, then outvote them. This step comes after the vote of the
//! photos of one epoch and before stones are carried. Epochs with masks stay as they are.

use super::carry::{shapes, shift_back};
use super::label::{DiskLabels, Labelled, Labels, tabulate};
use super::r#match::match_in;
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
use stonewise_core::stone::{MatchOutcome, Stone, UnmatchedReason};
use stonewise_core::transfer::{
    AuditEvent, JoinReport, Joined, PlacedShape, Shown, StoneInstances, Transfer, Whole, join_parts,
    photos_facing,
};

/// What the step says about the stones that it joined.
const REPORT: &str = "report.json";

/// Joins parts in the first epoch, by the stones of later epochs, then in each later epoch, by those of the
/// first.
pub fn join(context: &Context, photos: &[Segmented], mut labelled: Vec<Labelled>) -> Result<Vec<Labelled>> {
    let epochs = &context.project.epochs;
    if !context.project.settings.carry.enabled || epochs.iter().all(|e| e.masks.is_some()) {
        return Ok(labelled);
    }
    let steepest = context.project.settings.label.max_incidence_rad;
    let mut into_first = Vec::new();
    for number in 2..=labelled.len() {
        let report = match_in(
            context,
            &format!("join-match-{number}"),
            &labelled[0],
            &labelled[number - 1],
        )?;
        let matching = Matching::new(&labelled, number, &report);
        into_first.extend(matching.whole_in_later(&photos[number - 1], steepest));
    }
    let in_first = join_into(context, 1, photos, &mut labelled, into_first)?;
    // A stone that was divided alike in the first and a later epoch had partners before.
    let name = match in_first.is_empty() {
        true => "join-match",
        false => "join-match-again",
    };
    let shown: BTreeMap<StoneId, Shown> = in_first
        .iter()
        .filter_map(|joined| Some((*joined.parts.first()?, joined.shown)))
        .collect();
    for number in 2..=labelled.len() {
        let report = match_in(
            context,
            &format!("{name}-{number}"),
            &labelled[0],
            &labelled[number - 1],
        )?;
        let matching = Matching::new(&labelled, number, &report);
        let mut asked = matching.whole_in_first(&photos[0], steepest);
        for stone in &mut asked {
            stone.shown = *shown.get(&stone.stone).unwrap_or(&stone.shown);
        }
        join_into(context, number, photos, &mut labelled, asked)?;
    }
    Ok(labelled)
}

/// A stone that another epoch may show in parts.
#[derive(Clone, Debug, Serialize)]
struct Asked {
    /// The epoch that shows it, from 1.
    from: usize,
    stone: StoneId,
    outward: Vector3<f64>,
    /// How its surroundings moved from that epoch to the other.
    shift: Vector3<f64>,
    /// By the photos of the epoch that shows it as a whole: that epoch, or the one that it was joined by.
    shown: Shown,
}

impl Asked {
    fn new(photos: &Segmented, from: usize, stone: &Stone, shift: Vector3<f64>, steepest: f64) -> Self {
        let facing = photos_facing(&photos.views, &stone.centroid, &stone.normal, steepest) as u32;
        Self {
            from,
            stone: stone.id,
            outward: stone.normal,
            shift,
            shown: Shown {
                photos: stone.photos,
                missed: facing.saturating_sub(stone.photos),
            },
        }
    }
}

/// The first epoch and a later one, with their matches.
struct Matching<'a> {
    labelled: [&'a Labelled; 2],
    /// Of the epochs, from 1.
    numbers: [usize; 2],
    report: &'a MatchReport,
}

impl<'a> Matching<'a> {
    fn new(labelled: &'a [Labelled], number: usize, report: &'a MatchReport) -> Self {
        Self {
            labelled: [&labelled[0], &labelled[number - 1]],
            numbers: [1, number],
            report,
        }
    }

    /// Stones of the first epoch that may be the whole of later stones without a partner.
    fn whole_in_first(&self, photos: &Segmented, steepest: f64) -> Vec<Asked> {
        let [first, later] = self.labelled;
        let alone = |s: &&Stone| self.report.unmatched_second.binary_search(&s.id).is_ok();
        let alone: Vec<&Stone> = later.stones.iter().filter(alone).collect();
        let wholes = first.stones.iter().zip(&self.report.local_shifts);
        wholes
            .filter(|(whole, shift)| alone.iter().any(|part| may_be_part(part, whole, shift)))
            .map(|(whole, shift)| Asked::new(photos, self.numbers[0], whole, *shift, steepest))
            .collect()
    }

    /// Stones of the later epoch that may be the whole of first stones without a partner.
    fn whole_in_later(&self, photos: &Segmented, steepest: f64) -> Vec<Asked> {
        let [first, later] = self.labelled;
        let outcomes = first.stones.iter().zip(&self.report.outcomes);
        let alone: Vec<&Stone> = outcomes
            .filter(|(_, (_, outcome))| {
                matches!(outcome, MatchOutcome::Unmatched(reason) if *reason != UnmatchedReason::Unseen)
            })
            .map(|(stone, _)| stone)
            .collect();
        let asked = |whole: &Stone| {
            let shift = shift_back(&first.stones, self.report, whole)?;
            let has_part = alone.iter().any(|part| may_be_part(part, whole, &shift));
            has_part.then(|| Asked::new(photos, self.numbers[1], whole, shift, steepest))
        };
        later.stones.iter().filter_map(asked).collect()
    }
}

/// Whether a stone is near enough to be a part of another that moved by `shift`, and smaller: within 1.4 sizes
/// (square roots of the area), where the ends of a stone lie that is eight times as long as high.
fn may_be_part(part: &Stone, whole: &Stone, shift: &Vector3<f64>) -> bool {
    let apart_m = (whole.centroid + shift - part.centroid).norm();
    part.area_m2 < whole.area_m2 && apart_m * apart_m < 2.0 * whole.area_m2
}

/// Joins the parts that an epoch has of stones of other epochs; returns the new stones.
fn join_into(
    context: &Context,
    number: usize,
    photos: &[Segmented],
    labelled: &mut Vec<Labelled>,
    asked: Vec<Asked>,
) -> Result<Vec<Joined>> {
    if asked.is_empty() || context.project.epochs[number - 1].masks.is_some() {
        return Ok(Vec::new());
    }
    let missed_weight = context.project.settings.label.missed_weight;
    let sources: BTreeSet<usize> = asked.iter().map(|a| a.from).collect();
    let mut keys = vec![labelled[number - 1].key.as_str()];
    keys.extend(sources.iter().map(|&from| labelled[from - 1].key.as_str()));
    let key = Key::new("join", &(missed_weight, &asked), &keys);
    let step = context.step(&format!("join-{number}"), key, |step, _| {
        let own = &labelled[number - 1];
        let mut target = DiskLabels::new(step.path(), &own.ingested.tiles.surveyed);
        let shapes = shapes(
            context,
            labelled,
            asked.iter().map(|a| (a.from, a.stone, a.outward)),
        )?;
        let wholes = asked.iter().filter_map(|a| {
            let placed = PlacedShape {
                shape: shapes.get(&(a.from, a.stone))?,
                shift: a.shift,
            };
            Some(Whole {
                placed,
                shown: a.shown,
            })
        });
        let report = join_parts(
            &own.ingested.tiles,
            &own.store,
            &mut target,
            &wholes.collect::<Vec<_>>(),
            &own.stones,
            missed_weight,
            context.progress,
        )?;
        write_json(&step.file(REPORT), &report)
    })?;
    let report: JoinReport = read_json(&step.file(REPORT))?;
    if report.joined.is_empty() {
        return Ok(Vec::new());
    }
    let own = labelled.remove(number - 1);
    let mut store = own.store;
    store.replace(
        &report.tiles,
        &DiskLabels::new(step.path(), &own.ingested.tiles.surveyed),
    );
    let labels = Labels {
        transfer: joined(own.transfer, &report),
        store,
        step,
    };
    let photos = &photos[number - 1];
    let tabulated = tabulate(context, number, "stones-joined", photos, own.ingested, labels)?;
    labelled.insert(number - 1, tabulated);
    Ok(report.joined)
}

/// The instances of each stone in photos; those of joined parts are those of the new stone.
fn joined(transfer: Transfer, report: &JoinReport) -> Transfer {
    let new = report
        .joined
        .iter()
        .filter_map(|joined| Some((&joined.parts, *joined.parts.first()?)));
    let of_part = new.flat_map(|(parts, number)| parts.iter().map(move |part| (*part, number)));
    let number: BTreeMap<StoneId, StoneId> = of_part.collect();
    let mut instances: BTreeMap<StoneId, Vec<_>> = BTreeMap::new();
    for stone in transfer.stones {
        let number = number.get(&stone.stone).copied().unwrap_or(stone.stone);
        instances.entry(number).or_default().extend(stone.instances);
    }
    let stones = instances.into_iter().map(|(stone, mut instances)| {
        instances.sort_unstable();
        instances.dedup();
        StoneInstances { stone, instances }
    });
    let mut audit = transfer.audit;
    audit.extend(report.joined.iter().map(|joined| AuditEvent::JoinedParts {
        stones: joined.parts.clone(),
    }));
    Transfer {
        stones: stones.collect(),
        audit,
        ..transfer
    }
}
