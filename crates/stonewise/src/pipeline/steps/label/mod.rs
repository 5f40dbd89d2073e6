//! An epoch's points with the stone of each.

pub mod batches;
mod disk_labels;
mod step_key;

use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::steps::ingest::Ingested;
use crate::pipeline::steps::segment::Segmented;
use crate::storage::step::{Key, StepDir};
use batches::LabelBatches;
pub use disk_labels::DiskLabels;
use std::collections::BTreeMap;
use step_key::{label_key, label_name};
use stonewise_core::cloud::TileSource;
use stonewise_core::id::StoneId;
use stonewise_core::progress::Progress;
use stonewise_core::registration::StoneExtents;
use stonewise_core::stone::Stone;
use stonewise_core::transfer::{LabelStore, TileLabels, Transfer, build_stones, transfer_labels};

/// What was decided about the instances, in the step's folder.
const TRANSFER: &str = "transfer.json";

/// A labelled epoch: its points (moved, where the project says so), their labels, its stones.
pub struct Labelled {
    /// Points.
    pub ingested: Ingested,
    /// Stones, ascending by id.
    pub stones: Vec<Stone>,
    /// Which instances make up each stone, and what was decided about them.
    pub transfer: Transfer,
    /// Stones that a person made or changed, with the number of the last edit that did so.
    pub edited: BTreeMap<StoneId, u32>,
    /// Stones that no photo of the epoch shows, with the number of the epoch from which they were carried.
    pub carried: BTreeMap<StoneId, usize>,
    /// Key of everything above.
    pub key: Key,
    pub(super) store: DiskLabels,
}

impl Labelled {
    /// Labels of a tile's points.
    pub fn labels(&self, tile: usize) -> Result<TileLabels> {
        self.store.read(tile)
    }

    /// Boxes around the points of all stones. Cost: one pass over all tiles.
    pub fn extents(&self, progress: &dyn Progress) -> Result<StoneExtents> {
        let tiles = &self.ingested.tiles;
        let mut extents = StoneExtents::default();
        progress.each("find stones", 0..tiles.tile_count(), |tile| -> Result<()> {
            let (cloud, labels) = (tiles.load(tile)?, self.labels(tile)?);
            for i in (0..cloud.len()).filter(|&i| labels.stone[i] != 0) {
                extents.add(labels.stone[i], cloud.world(i));
            }
            Ok(())
        })?;
        Ok(extents)
    }
}

/// Carries the photos' labels into the points of an epoch; then moves the points, where the project says so.
pub fn label(context: &Context, number: usize, ingested: Ingested, photos: &Segmented) -> Result<Labelled> {
    let step = transferred(context, number, &ingested, photos)?;
    let transfer = read_json(&step.file(TRANSFER))?;
    let store = DiskLabels::new(step.path(), &ingested.tiles.surveyed);
    let labels = Labels {
        transfer,
        store,
        step,
    };
    tabulate(context, number, "stones", photos, ingested, labels)
}

/// Carries the photos' labels into the points of an epoch.
fn transferred(context: &Context, number: usize, ingested: &Ingested, photos: &Segmented) -> Result<StepDir> {
    let params = &context.project.settings.label;
    let tiles = &ingested.tiles.surveyed;
    let key = label_key(context, number, ingested, photos);
    context.step(&label_name(number), key, |step, _| {
        let mut store = DiskLabels::new(step.path(), tiles);
        let mask = |image| photos.labels(image).map(Some);
        let transfer = transfer_labels(tiles, &photos.views, mask, &mut store, params, context.progress)?;
        write_json(&step.file(TRANSFER), &transfer)
    })
}

/// The same from batches of tiles that other processes labelled.
pub fn gather_labels(
    context: &Context,
    number: usize,
    ingested: &Ingested,
    photos: &Segmented,
    batches: usize,
) -> Result<()> {
    let (name, key) = (label_name(number), label_key(context, number, ingested, photos));
    context.step(&name, key.clone(), |step, _| {
        let batches = LabelBatches::new(context, number, ingested, photos, batches);
        write_json(&step.file(TRANSFER), &batches.gather(step)?)
    })?;
    context.store.remove_parts(&name, &key)
}

/// The labels of an epoch, before its stones are tabulated.
pub(super) struct Labels {
    pub(super) transfer: Transfer,
    pub(super) store: DiskLabels,
    /// The step that made them.
    pub(super) step: StepDir,
}

/// Tabulates the stones of an epoch in a step of this name.
pub(super) fn tabulate(
    context: &Context,
    number: usize,
    name: &str,
    photos: &Segmented,
    ingested: Ingested,
    labels: Labels,
) -> Result<Labelled> {
    let Labels {
        transfer,
        store,
        step: labelled,
    } = labels;
    let params = &context.project.settings.stones;
    let key = Key::new(
        "stones",
        &(params, &ingested.tiles.motion),
        &[labelled.key().as_str()],
    );
    let step = context.step(&format!("{name}-{number}"), key, |step, _| {
        let stones = build_stones(
            &ingested.tiles,
            &store,
            &photos.views,
            &transfer.stones,
            params,
            context.progress,
        )?;
        write_json(&step.file("stones.json"), &stones)
    })?;
    let stones: Vec<Stone> = read_json(&step.file("stones.json"))?;
    if stones.is_empty() {
        let why = match context.project.part {
            Some(_) => "are there stones in the part of the wall that the run is limited to?",
            None => "do its cameras and clouds share one frame?",
        };
        let name = &context.project.epochs[number - 1].name;
        return Err(Error::Survey(format!(
            "no stone of epoch {name:?} got any points: {why}"
        )));
    }
    Ok(Labelled {
        ingested,
        stones,
        transfer,
        edited: BTreeMap::new(),
        carried: BTreeMap::new(),
        key: step.key().clone(),
        store,
    })
}

/// The last number in use, also by stones of the vote that too few points show to be in the list.
pub(super) fn last_number(labelled: &Labelled) -> u32 {
    let listed = labelled.stones.iter().map(|s| s.id.0);
    let voted = labelled.transfer.stones.iter().map(|s| s.stone.0);
    listed.chain(voted).max().unwrap_or(0)
}
