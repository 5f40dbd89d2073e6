//! Stones that the detector divided in one epoch, from the epochs that show them whole.
//!
//! The photos of an epoch agree on what they show, but a stain or a shadow can divide a stone in most of
//! them. Photos of another epoch, in another light, then outvote them. This step comes after the vote of the
//! photos of one epoch and before stones are carried. Epochs with masks stay as they are.

use super::label::{Labelled, Labels, STONES, tabulate};
use super::segment::Segmented;
use super::shapes::{Matches, Others, is_corrected, shapes};
use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Need, Phase, Run, Step};
use crate::pipeline::until::Until;
use crate::storage::labels::DiskLabels;
use crate::storage::step::Key;
use nalgebra::Vector3;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::id::StoneId;
use stonewise_core::stone::Stone;
use stonewise_core::transfer::{
    AuditEvent, JoinReport, Joined, PlacedShape, Shown, StoneInstances, Transfer, Whole, join_parts,
    photos_facing,
};

/// Joins parts in the reference, by the stones of later epochs, then in each later epoch, by those of the
/// reference.
pub static JOIN: Step = Step {
    name: "join",
    phase: Some(Phase::Find),
    about: About::Epoch,
    needs: &[Need::all(&STONES), Need::reference(&JOIN)],
    wanted: |until| until >= Until::Labelled,
    applies: is_corrected,
    cost: Some(|sizes, _| Cost::of(2, sizes.every_pair_bytes())),
    make: |run, epoch| run.joined(epoch).map(drop),
    ..Step::PLAIN
};

/// What the step says about the stones that it joined.
const REPORT: &str = "report.json";

/// An epoch in which parts of stones are joined.
pub struct JoinedEpoch {
    /// Its labels.
    pub labelled: Arc<Labelled>,
    /// The new stones.
    joined: Vec<Joined>,
}

impl Run<'_> {
    /// An epoch in which parts of stones are joined.
    pub fn joined(&self, epoch: EpochId) -> Result<Arc<JoinedEpoch>> {
        if !is_corrected(self.context.project, epoch) {
            return Ok(Arc::new(JoinedEpoch::unchanged(self.found(epoch)?)));
        }
        self.once(&JOIN, epoch, || match epoch.is_reference() {
            true => join_reference(self),
            false => join_later(self, epoch),
        })
    }
}

impl JoinedEpoch {
    fn unchanged(labelled: Arc<Labelled>) -> Self {
        let joined = Vec::new();
        Self { labelled, joined }
    }
}

fn join_reference(run: &Run) -> Result<JoinedEpoch> {
    let steepest = run.context.project.settings.label.max_incidence_rad;
    let first = run.found(EpochId::REFERENCE)?;
    let (mut asked, mut others) = (Vec::new(), Others::new());
    for later in run.context.project.epochs.later_ids() {
        let labelled = run.found(later)?;
        let pair = Pair::new(&*first, &*labelled);
        let report = run.matches("join-match", pair, later)?;
        let (matches, photos) = (Matches::new(pair, &report), run.posed(later)?);
        asked.extend(whole_in_later(
            &matches,
            later,
            &labelled.stones,
            &photos,
            steepest,
        ));
        others.insert(later, labelled);
    }
    join_into(run, EpochId::REFERENCE, first, &others, asked)
}

fn join_later(run: &Run, later: EpochId) -> Result<JoinedEpoch> {
    let steepest = run.context.project.settings.label.max_incidence_rad;
    let (first, own) = (run.joined(EpochId::REFERENCE)?, run.found(later)?);
    // A stone that was divided alike in the reference and a later epoch had partners before.
    let name = match first.joined.is_empty() {
        true => "join-match",
        false => "join-match-again",
    };
    let pair = Pair::new(&*first.labelled, &*own);
    let report = run.matches(name, pair, later)?;
    let photos = run.posed(EpochId::REFERENCE)?;
    let mut asked = whole_in_first(&Matches::new(pair, &report), &photos, steepest);
    let shown: BTreeMap<StoneId, Shown> = { first.joined.iter() }
        .filter_map(|joined| Some((*joined.parts.first()?, joined.shown)))
        .collect();
    for stone in &mut asked {
        stone.shown = *shown.get(&stone.stone).unwrap_or(&stone.shown);
    }
    let others = Others::from([(EpochId::REFERENCE, Arc::clone(&first.labelled))]);
    join_into(run, later, own, &others, asked)
}

/// A stone that another epoch may show in parts.
#[derive(Clone, Debug, Serialize)]
struct Asked {
    /// The epoch that shows it.
    from: EpochId,
    stone: StoneId,
    outward: Vector3<f64>,
    /// How its surroundings moved from that epoch to the other.
    shift: Vector3<f64>,
    /// By the photos of the epoch that shows it as a whole: that epoch, or the one that it was joined by.
    shown: Shown,
}

impl Asked {
    fn new(photos: &Segmented, from: EpochId, stone: &Stone, shift: Vector3<f64>, steepest: f64) -> Self {
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

/// Stones of the first epoch that may be the whole of later stones without a partner.
fn whole_in_first(matches: &Matches, photos: &Segmented, steepest: f64) -> Vec<Asked> {
    let has_part = |(whole, shift): &&(&Stone, Vector3<f64>)| {
        let mut alone = matches.later_alone.iter();
        alone.any(|part| may_be_part(part, whole, shift))
    };
    let wholes = matches.first.iter().filter(has_part);
    wholes
        .map(|(whole, shift)| Asked::new(photos, EpochId::REFERENCE, whole, *shift, steepest))
        .collect()
}

/// Stones of a later epoch that may be the whole of first stones without a partner.
fn whole_in_later(
    matches: &Matches,
    later: EpochId,
    stones: &[Stone],
    photos: &Segmented,
    steepest: f64,
) -> Vec<Asked> {
    let asked = |whole: &Stone| {
        let shift = matches.shift_back(whole)?;
        let mut alone = matches.first_alone.iter();
        let has_part = alone.any(|(part, _)| may_be_part(part, whole, &shift));
        has_part.then(|| Asked::new(photos, later, whole, shift, steepest))
    };
    stones.iter().filter_map(asked).collect()
}

/// Whether a stone is near enough to be a part of another that moved by `shift`, and smaller: within 1.4 sizes
/// (square roots of the area), where the ends of a stone lie that is eight times as long as high.
pub fn may_be_part(part: &Stone, whole: &Stone, shift: &Vector3<f64>) -> bool {
    let apart_m = (whole.centroid + shift - part.centroid).norm();
    part.area_m2 < whole.area_m2 && apart_m * apart_m < 2.0 * whole.area_m2
}

/// Joins the parts that an epoch has of stones of other epochs.
fn join_into(
    run: &Run,
    epoch: EpochId,
    own: Arc<Labelled>,
    others: &Others,
    asked: Vec<Asked>,
) -> Result<JoinedEpoch> {
    if asked.is_empty() {
        return Ok(JoinedEpoch::unchanged(own));
    }
    let context = run.context;
    let missed_weight = context.project.settings.label.missed_weight;
    let sources: BTreeSet<EpochId> = asked.iter().map(|a| a.from).collect();
    let mut keys = vec![own.key.as_str()];
    keys.extend(
        sources
            .iter()
            .filter_map(|from| Some(others.get(from)?.key.as_str())),
    );
    let key = Key::new("join", &(missed_weight, &asked), &keys);
    let step = context.step(&format!("join-{epoch}"), key, |step, _| {
        let mut target = DiskLabels::new(step.path(), &own.ingested.tiles.surveyed);
        let wanted = asked.iter().map(|a| (a.from, a.stone, a.outward));
        let shapes = shapes(others, wanted, context.progress)?;
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
        return Ok(JoinedEpoch::unchanged(own));
    }
    let mut store = own.store.clone();
    store.replace(
        &report.tiles,
        &DiskLabels::new(step.path(), &own.ingested.tiles.surveyed),
    );
    let labels = Labels {
        transfer: joined(own.transfer.clone(), &report),
        store,
        step,
    };

    Ok(JoinedEpoch {
        labelled: Arc::new(tabulate(run, epoch, "stones-joined", labels)?),
        joined: report.joined,
    })
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
