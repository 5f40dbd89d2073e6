//! Corrections by hand, applied to the labelled clouds of all epochs.
//!
//! They come after the vote of the photos and before the stones are tabulated, so that photos, masks and
//! votes are taken over from a run without them, and stones that no edit touches keep their points and their
//! number.

mod boxes;
mod photo_places;

use super::confirm::CONFIRM;
use super::label::{Labelled, Labels, last_number, tabulate};
use super::stone_outlines::make_outlines;
use crate::edits::EditsFile;
use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{Need, Phase, Run, Step};
use crate::pipeline::until::Until;
use crate::results::{Facade, facade_of, read_outlines};
use crate::storage::labels::DiskLabels;
use crate::storage::step::Key;
use boxes::Places;
use nalgebra::Point3;
use photo_places::photo_places;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use stonewise_core::epoch::{EpochId, Epochs, Pair};
use stonewise_core::id::StoneId;
use stonewise_core::transfer::{
    EditEffect, EditReport, EditedWall, LabelEdit, NoEffect, StoneInstances, edit_labels,
};

/// Applies the project's edits to all epochs; an epoch that none changes stays as it is.
pub static EDIT: Step = Step {
    name: "edit",
    phase: Some(Phase::Find),
    needs: &[Need::all(&CONFIRM)],
    wanted: |until| until >= Until::Labelled,
    applies: |project, _| project.edits.is_some(),
    cost: Some(|sizes, _| Cost::of(1, 2 * sizes.every_pair_bytes())),
    make: |run, _| run.corrected().map(drop),
    ..Step::PLAIN
};

/// All epochs as a person corrected them.
pub struct Corrected {
    /// Their labels.
    pub labelled: Epochs<Arc<Labelled>>,
    /// What the edits did; `None` where there are none.
    pub edited: Option<Edited>,
}

/// What the edits did.
pub struct Edited {
    /// The unrolled wall of the stones as they were found: edits do not move the places of other stones.
    pub facade: Facade,
    /// By epoch.
    pub effects: Epochs<Effects>,
}

/// What each edit of the file did in an epoch; `None` where it does not concern the epoch.
pub type Effects = Vec<Option<std::result::Result<EditEffect, NoEffect>>>;

impl Run<'_> {
    /// All epochs as a person corrected them.
    pub fn corrected(&self) -> Result<Arc<Corrected>> {
        self.once(&EDIT, EpochId::REFERENCE, || {
            let epochs = self.context.project.epochs.ids();
            let labelled = epochs.map(|epoch| self.confirmed(epoch));
            edit(self, labelled.collect::<Result<Vec<_>>>()?.into())
        })
    }

    /// The labels of an epoch as every later step takes them.
    pub fn labelled(&self, epoch: EpochId) -> Result<Arc<Labelled>> {
        Ok(Arc::clone(&self.corrected()?.labelled[epoch]))
    }

    /// The labels of the reference and of a later epoch.
    pub fn labelled_pair(&self, later: EpochId) -> Result<Pair<Arc<Labelled>>> {
        Ok(self.corrected()?.labelled.pair(later).map(Arc::clone))
    }
}

fn edit(run: &Run, labelled: Epochs<Arc<Labelled>>) -> Result<Corrected> {
    let Some(file) = &run.context.project.edits else {
        let edited = None;
        return Ok(Corrected { labelled, edited });
    };
    let first = labelled.reference();
    let outlines = read_outlines(make_outlines(run.context, first, "edit-outlines")?.path())?;
    let found = first.stones.iter().map(|s| (s.id.0, s.centroid));
    let facade = facade_of(found, &outlines);
    let drawn_on = file.facade.as_ref().unwrap_or(&facade);
    let places = photo_places(run, file, drawn_on, &labelled)?;
    let drawn = Drawn {
        file,
        places: &places,
        wall: drawn_on,
    };
    let mut effects = Vec::new();
    let mut edited = Vec::new();
    for (id, labelled) in labelled.with_ids() {
        let (epoch, done) = edit_epoch(run, id, &drawn, labelled)?;
        edited.push(epoch);
        effects.push(done);
    }
    let effects = effects.into();
    Ok(Corrected {
        labelled: edited.into(),
        edited: Some(Edited { facade, effects }),
    })
}

/// The edits with their shapes on the wall.
struct Drawn<'a> {
    file: &'a EditsFile,
    /// One per edit.
    places: &'a [Places],
    /// The unrolled wall on which they were drawn.
    wall: &'a Facade,
}

/// Applies the edits that concern one epoch.
fn edit_epoch(
    run: &Run,
    id: EpochId,
    drawn: &Drawn,
    labelled: &Arc<Labelled>,
) -> Result<(Arc<Labelled>, Effects)> {
    let context = run.context;
    let Drawn { file, places, wall } = *drawn;
    let epoch = &context.project.epochs[id].name;
    let mut effects = vec![None; file.edits.len()];
    let mut asked: Vec<(usize, LabelEdit)> = Vec::new();

    for (index, (edit, places)) in file.edits.iter().zip(places).enumerate() {
        match places {
            _ if !edit.concerns(epoch) => {}
            Ok(shape) => asked.push((index, edit.on_wall(shape.clone()))),
            Err(reason) => effects[index] = Some(Err(reason.clone())),
        }
    }

    let (indices, edits): (Vec<usize>, Vec<LabelEdit>) = asked.into_iter().unzip();
    let tiles = &labelled.ingested.tiles.surveyed;
    let key = Key::new("edit", &(&edits, wall), &[labelled.key.as_str()]);
    let step = context.step(&format!("edit-{id}"), key, |step, _| {
        let mut target = DiskLabels::new(step.path(), tiles);
        let place = |p: &Point3<f64>| {
            let at = wall.place(p);
            Point3::new(at.x, at.y, wall.out_m(p))
        };
        let on_wall = EditedWall {
            place: &place,
            stones: &facing(labelled, wall),
            min_points: context.project.settings.label.min_points,
            first_new: last_number(labelled) + 1,
        };
        let report = edit_labels(
            tiles,
            &labelled.store,
            &mut target,
            &on_wall,
            &edits,
            context.progress,
        )?;
        write_json(&step.file(REPORT), &report)
    })?;

    let report: EditReport = read_json(&step.file(REPORT))?;
    for (&index, effect) in indices.iter().zip(&report.effects) {
        effects[index] = Some(effect.clone());
    }
    if report.tiles.is_empty() {
        return Ok((Arc::clone(labelled), effects));
    }
    let mut store = labelled.store.clone();
    store.replace(&report.tiles, &DiskLabels::new(step.path(), tiles));
    let mut transfer = labelled.transfer.clone();
    let mut carried = labelled.carried.clone();
    carried.retain(|stone, _| !report.gone.contains(&stone.0));
    transfer.stones = instances(&transfer.stones, &report);
    let labels = Labels {
        transfer,
        store,
        step,
    };

    let number_of = |index: &usize| indices[*index] as u32 + 1;
    let edited = report.edited_by.iter();
    let edited = edited.map(|(stone, index)| (StoneId(*stone), number_of(index)));
    let tabulated = Labelled {
        edited: edited.collect(),
        carried,
        ..tabulate(run, id, "stones-edited", labels)?
    };
    Ok((Arc::new(tabulated), effects))
}

/// What the step says about its edits.
const REPORT: &str = "report.json";

/// Stones on the side of the wall that is unrolled: a wall seen from both sides has others behind them.
fn facing(labelled: &Labelled, wall: &Facade) -> BTreeSet<StoneId> {
    let faces = labelled
        .stones
        .iter()
        .filter(|s| s.normal.dot(&wall.frame_at(&s.centroid).out) > 0.0);
    faces.map(|s| s.id).collect()
}

/// The instances that make up each stone: of an edited one those of all stones whose points it has.
fn instances(found: &[StoneInstances], report: &EditReport) -> Vec<StoneInstances> {
    let known: BTreeMap<u32, &StoneInstances> = found.iter().map(|s| (s.stone.0, s)).collect();
    let changed = |stone: &StoneInstances| {
        report.gone.contains(&stone.stone.0) || report.origins.contains_key(&stone.stone.0)
    };
    let mut all: Vec<StoneInstances> = found.iter().filter(|s| !changed(s)).cloned().collect();
    for (&stone, origins) in &report.origins {
        let mut instances: Vec<_> = origins
            .iter()
            .filter_map(|o| known.get(o))
            .flat_map(|s| s.instances.iter().copied())
            .collect();
        instances.sort_unstable();
        instances.dedup();
        all.push(StoneInstances {
            stone: StoneId(stone),
            instances,
        });
    }
    all.sort_by_key(|s| s.stone);
    all
}
