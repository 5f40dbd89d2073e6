//! Stones that the detector missed or merged in one epoch, from the epochs that show them.
//!
//! A stone that is not detected is not necessarily gone: the detector misses one stone in seven. A stone of
//! one epoch without a partner in another is therefore looked for in the other's cloud, where its neighbours
//! predict it. This step comes after the vote of the photos and before edits by hand, which can overrule it.
//! Epochs with masks stay as they are.

use super::join::{JOIN, may_be_part};
use super::label::{Labelled, Labels, last_number, tabulate};
use super::shapes::{Matches, Others, is_corrected, shapes};
use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Need, Phase, Run, Step};
use crate::pipeline::until::Until;
use crate::storage::labels::DiskLabels;
use crate::storage::step::Key;
use nalgebra::{Point3, Vector3};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::geometry::View;
use stonewise_core::id::StoneId;
use stonewise_core::stone::Stone;
use stonewise_core::transfer::{
    AuditEvent, CarriedStone, CarryReport, NotCarried, PlacedShape, Sought, StoneInstances, carry_labels,
    photos_facing,
};

/// Looks for stones that one epoch shows and another does not: those of later epochs in the reference, then
/// those of the reference in the later ones.
pub static CARRY: Step = Step {
    name: "carry",
    phase: Some(Phase::Find),
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

/// A partner with more than this share of a stone's area is no part of it. 0.9: masks of the same stone differ by less.
const LARGEST_PART: f64 = 0.9;
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
    let mut maybe_merged = points_of(&first.stones);
    for later in run.context.project.epochs.later_ids() {
        let labelled = Arc::clone(&run.joined(later)?.labelled);
        let pair = Pair::new(&**first, &*labelled);
        let report = run.matches("carry-match", pair, later)?;
        let matches = Matches::new(pair, &report);
        let partners = partners(&matches);
        wishes.extend(wishes_of_first(run, later, &matches, &partners)?);
        for partners in partners.iter().filter(|p| p.part != Some(Part::Later)) {
            maybe_merged.remove(&partners.first.id);
        }
        others.insert(later, labelled);
    }
    carry_into(run, EpochId::REFERENCE, first, &others, wishes, &maybe_merged)
}

fn into_later(run: &Run, later: EpochId) -> Result<Carried> {
    let (first, labelled) = (run.carried(EpochId::REFERENCE)?, &run.joined(later)?.labelled);
    // Stones that were carried into the first epoch, or divided there, may have other partners now.
    let report = match first.is_changed {
        true => run.matches("carry-match-again", Pair::new(&first.labelled, labelled), later)?,
        false => {
            let before = run.joined(EpochId::REFERENCE)?;
            run.matches("carry-match", Pair::new(&before.labelled, labelled), later)?
        }
    };
    let matches = Matches::new(Pair::new(&*first.labelled, &**labelled), &report);
    let partners = partners(&matches);
    let wishes = wishes_of_later(run, later, &matches, &partners)?;
    let others = Others::from([(EpochId::REFERENCE, Arc::clone(&first.labelled))]);
    let mut maybe_merged = points_of(&labelled.stones);
    for partners in partners.iter().filter(|p| p.part != Some(Part::First)) {
        maybe_merged.remove(&partners.later.id);
    }
    carry_into(run, later, labelled, &others, wishes, &maybe_merged)
}

fn points_of(stones: &[Stone]) -> BTreeMap<StoneId, u64> {
    stones.iter().map(|s| (s.id, u64::from(s.points))).collect()
}

/// A stone that is to be looked for in another epoch: it has no partner there, or one that may be several stones.
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
    /// Whether it has a partner there; the partner may then be several stones.
    has_partner: bool,
}

impl Wish {
    /// `from`: the epoch that shows the stone; `to`: the other. None where the views of the other show the place
    /// nowhere, because it lies before the wall.
    fn new(
        run: &Run,
        [from, to]: [EpochId; 2],
        sought: (&Stone, Vector3<f64>, bool),
    ) -> Result<Option<Self>> {
        let (stone, shift, has_partner) = sought;
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
            has_partner,
        }))
    }

    /// Whether the photos of both epochs together accept the stone, by the rule of the vote in one epoch.
    fn is_elected(&self, missed_weight: f64) -> bool {
        f64::from(self.photos) >= missed_weight * f64::from(self.missed)
    }
}

/// Stones of two epochs that match.
struct Partners<'a> {
    first: &'a Stone,
    later: &'a Stone,
    /// How their surroundings moved from the first epoch to the later.
    shift: Vector3<f64>,
    /// Which of the two may be only a part of the other.
    part: Option<Part>,
}

#[derive(Clone, Copy, PartialEq)]
enum Part {
    First,
    Later,
}

/// The stones that match, and which of them may be merged.
fn partners<'a>(matches: &Matches<'a>) -> Vec<Partners<'a>> {
    let partners = matches.partners.iter().map(|&(first, later, shift)| {
        let mut later_alone = matches.later_alone.iter().copied();
        let mut first_alone = matches.first_alone.iter().map(|(stone, _)| *stone);
        let part = match () {
            () if is_merged(first, later, &shift, &mut later_alone) => Some(Part::Later),
            () if is_merged(later, first, &-shift, &mut first_alone) => Some(Part::First),
            () => None,
        };
        Partners {
            first,
            later,
            shift,
            part,
        }
    });
    partners.collect()
}

/// Stones of the later epoch to look for in the first: those without a partner, and those that may be a part of their
/// partner.
fn wishes_of_first(run: &Run, later: EpochId, matches: &Matches, partners: &[Partners]) -> Result<Vec<Wish>> {
    let parts = partners.iter().filter(|p| p.part == Some(Part::Later));
    let parts = parts.map(|p| (p.later, -p.shift, true));
    let missing =
        { matches.later_alone.iter() }.filter_map(|stone| Some((*stone, matches.shift_back(stone)?, false)));
    let wish = |sought| Wish::new(run, [later, EpochId::REFERENCE], sought).transpose();
    missing.chain(parts).filter_map(wish).collect()
}

/// Stones of the first epoch to look for in the later one, likewise; without those whose place that one does not show.
fn wishes_of_later(run: &Run, later: EpochId, matches: &Matches, partners: &[Partners]) -> Result<Vec<Wish>> {
    let parts = partners.iter().filter(|p| p.part == Some(Part::First));
    let parts = parts.map(|p| (p.first, p.shift, true));
    let missing = matches.first_alone.iter();
    let missing = missing.map(|(stone, shift)| (*stone, *shift, false));
    let wish = |sought| Wish::new(run, [EpochId::REFERENCE, later], sought).transpose();
    missing.chain(parts).filter_map(wish).collect()
}

/// Whether `whole` may be several stones: its partner is smaller, and near it lies a smaller stone of the partner's
/// epoch that has no partner. `shift`: how the surroundings of `whole` moved to that epoch.
fn is_merged<'a>(
    whole: &Stone,
    partner: &Stone,
    shift: &Vector3<f64>,
    alone: &mut impl Iterator<Item = &'a Stone>,
) -> bool {
    partner.area_m2 < LARGEST_PART * whole.area_m2 && alone.any(|stone| may_be_part(stone, whole, shift))
}

/// Looks for stones of other epochs in one; `maybe_merged`: the stones of that epoch that may be divided, with the
/// numbers of their points.
fn carry_into(
    run: &Run,
    epoch: EpochId,
    own: &Arc<Labelled>,
    others: &Others,
    wishes: Vec<Wish>,
    maybe_merged: &BTreeMap<StoneId, u64>,
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

    let key = Key::new("carry", &(params, &wishes, maybe_merged), &keys);
    let step = context.step(&format!("carry-{epoch}"), key, |step, _| {
        let mut target = DiskLabels::new(step.path(), &own.ingested.tiles.surveyed);
        let report = look_for(context, own, others, (&wishes, maybe_merged), &mut target)?;
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

    // A part that is not carried keeps its partner, so it was not missed.
    let missed = wishes.iter().zip(&report.outcomes);
    let missed = missed.filter(|(wish, outcome)| !wish.has_partner || outcome.is_ok());
    let attempts = missed.map(attempt).collect();
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
    transfer.stones.retain(|s| !report.divided.contains(&s.stone));
    let divided = report.divided.iter();
    transfer
        .audit
        .extend(divided.map(|&stone| AuditEvent::DividedStone { stone }));

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
    (wishes, maybe_merged): (&[Wish], &BTreeMap<StoneId, u64>),
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
    let sought = Sought {
        stones: &placed.collect::<Vec<_>>(),
        maybe_merged,
        first_new: last_number(own) + 1,
        min_points: settings.label.min_points,
    };
    let found = carry_labels(
        &own.ingested.tiles,
        &own.store,
        target,
        &sought,
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
        divided: found.divided,
        tiles: found.tiles,
    })
}
