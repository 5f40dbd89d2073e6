//! An epoch's points with the stone of each.

use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::cost::{Cost, Sizes};
use crate::pipeline::graph::{About, Need, Phase, Run, Step};
use crate::pipeline::steps::ingest::{INGEST, Ingested};
use crate::pipeline::steps::segment::{SEGMENT, Segmented};
use crate::pipeline::steps::views::has_no_photos;
use crate::pipeline::until::Until;
use crate::project::Project;
use crate::storage::epoch_tiles::{EpochTiles, KnownMotion};
use crate::storage::labels::DiskLabels;
use crate::storage::step::{Key, StepDir};
use nalgebra::Point3;
use std::collections::BTreeMap;
use std::sync::Arc;
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::Rigid3;
use stonewise_core::id::StoneId;
use stonewise_core::progress::Progress;
use stonewise_core::registration::StoneExtents;
use stonewise_core::stone::Stone;
use stonewise_core::transfer::{LabelStore, TileLabels, Transfer, build_stones, transfer_labels};

/// Carries the photos' labels into the points of an epoch.
pub static LABEL: Step = Step {
    name: "label",
    phase: Some(Phase::Find),
    about: About::Epoch,
    needs: &[Need::same(&INGEST), Need::same(&SEGMENT)],
    wanted: |until| until >= Until::Labelled,
    cost: Some(|sizes, epoch| Cost::of(4, depth_map_bytes(sizes) + sizes.cloud_bytes(epoch))),
    make: |run, epoch| run.voted(epoch).map(drop),
    ..Step::PLAIN
};

/// Finds how a later epoch lies in the frame of the reference, where the project file says so.
pub static ALIGN: Step = Step {
    name: "align",
    phase: Some(Phase::Find),
    about: About::Later,
    needs: &[Need::reference(&LABEL), Need::same(&LABEL)],
    wanted: |until| until >= Until::Labelled,
    applies: Project::is_aligned,
    cost: Some(|sizes, epoch| Cost::of(1, sizes.cloud_bytes(epoch))),
    make: |run, epoch| run.frame(epoch).map(drop),
    ..Step::PLAIN
};

/// Tabulates the stones of an epoch.
pub static STONES: Step = Step {
    name: "stones",
    about: About::Epoch,
    needs: &[Need::same(&LABEL), Need::same(&ALIGN)],
    wanted: |until| until >= Until::Labelled,
    cost: Some(|sizes, epoch| Cost::of(1, sizes.cloud_bytes(epoch))),
    make: |run, epoch| run.found(epoch).map(drop),
    ..Step::PLAIN
};

fn depth_map_bytes(sizes: &Sizes) -> u64 {
    u64::from(sizes.project.settings.label.depth_memory_mib) << 20
}

impl Run<'_> {
    /// The step in which the photos of an epoch voted.
    pub(super) fn voted(&self, epoch: EpochId) -> Result<Arc<StepDir>> {
        self.once(&LABEL, epoch, || {
            transferred(
                self.context,
                epoch,
                &*self.ingested(epoch)?,
                &*self.segmented(epoch)?,
            )
        })
    }

    /// The stones of an epoch as its photos show them.
    pub fn found(&self, epoch: EpochId) -> Result<Arc<Labelled>> {
        self.once(&STONES, epoch, || {
            let labels = self.votes(epoch)?;
            tabulate(self, epoch, "stones", labels)
        })
    }

    fn votes(&self, epoch: EpochId) -> Result<Labels> {
        let step = StepDir::clone(&*self.voted(epoch)?);
        Ok(Labels {
            transfer: read_json(&step.file(TRANSFER))?,
            store: DiskLabels::new(step.path(), &self.ingested(epoch)?.tiles.surveyed),
            step,
        })
    }

    /// The points of an epoch with the motion that the project prescribes. A stone moves as a whole, by the field at its
    /// centroid in the reference.
    fn moved(&self, epoch: EpochId) -> Result<Arc<Ingested>> {
        let placed = self.placed(epoch)?;
        let Some(KnownMotion { field, .. }) = &placed.tiles.motion else {
            return Ok(placed);
        };
        self.known(&format!("moved-{epoch}"), || {
            let frame = self.frame(epoch)?.unwrap_or_else(Rigid3::identity);
            let reference = self.found_in_own_frame(EpochId::REFERENCE)?;
            let displacement = |stone: &Stone| {
                let centroid = frame * stone.centroid;
                let apart = |c: &&Point3<f64>| (*c - centroid).norm_squared();
                let places = reference.iter().map(|s| &s.centroid);
                let nearest = places.min_by(|a, b| apart(a).total_cmp(&apart(b)));
                (stone.id.0, field.displacement_at(nearest.unwrap_or(&centroid)))
            };
            let displacements = self.found_in_own_frame(epoch)?.iter().map(displacement).collect();
            let (surveyed, labels) = (placed.tiles.surveyed.clone(), self.votes(epoch)?.store);
            let motion = KnownMotion::of_stones(field.clone(), labels, displacements, &surveyed)?;
            Ok(Ingested {
                step: placed.step.clone(),
                tiles: EpochTiles {
                    surveyed,
                    motion: Some(motion),
                },
            })
        })
    }

    /// The stones of an epoch in the frame of its own files. Cost: one pass over all tiles.
    pub(super) fn found_in_own_frame(&self, epoch: EpochId) -> Result<Arc<Vec<Stone>>> {
        self.known(&format!("{}-{epoch}", ALIGN.name), || {
            let labels = self.votes(epoch)?;
            Ok(build_stones(
                &self.ingested(epoch)?.tiles.surveyed,
                &labels.store,
                &self.segmented(epoch)?.views,
                &labels.transfer.stones,
                &self.context.project.settings.stones,
                self.context.progress,
            )?)
        })
    }
}

/// What was decided about the instances, in the step's folder.
const TRANSFER: &str = "transfer.json";

/// A labelled epoch: its points (moved, where the project says so), their labels, its stones.
pub struct Labelled {
    /// Points.
    pub ingested: Arc<Ingested>,
    /// Stones, ascending by id.
    pub stones: Vec<Stone>,
    /// Which instances make up each stone, and what was decided about them.
    pub transfer: Transfer,
    /// Stones that a person made or changed, with the number of the last edit that did so.
    pub edited: BTreeMap<StoneId, u32>,
    /// Stones that no photo of the epoch shows, with the epoch from which they were carried.
    pub carried: BTreeMap<StoneId, EpochId>,
    /// Key of everything above.
    pub key: Key,
    pub(super) store: DiskLabels,
}

impl Labelled {
    /// Labels of a tile's points.
    pub fn labels(&self, tile: usize) -> Result<TileLabels> {
        self.store.read(tile)
    }

    /// A tile's points and their labels.
    pub fn points(&self, tile: usize) -> Result<(Cloud, TileLabels)> {
        Ok((self.ingested.tiles.load(tile)?, self.labels(tile)?))
    }

    /// Boxes around the points of all stones. Cost: one pass over all tiles.
    pub fn extents(&self, progress: &dyn Progress) -> Result<StoneExtents> {
        let tiles = &self.ingested.tiles;
        let mut extents = StoneExtents::default();
        let load = |tile| self.points(tile);
        progress.each_prepared(
            "find stones",
            0..tiles.tile_count(),
            load,
            |_, (cloud, labels)| {
                for i in (0..cloud.len()).filter(|&i| labels.stone[i] != 0) {
                    extents.add(labels.stone[i], cloud.world(i));
                }
                Ok(())
            },
        )?;
        Ok(extents)
    }
}

/// Carries the photos' labels into the points of an epoch.
fn transferred(
    context: &Context,
    epoch: EpochId,
    ingested: &Ingested,
    photos: &Segmented,
) -> Result<StepDir> {
    let params = &context.project.settings.label;
    let tiles = &ingested.tiles.surveyed;
    let map = &context.project.epochs[epoch].map;
    let geoid = map.geoid.as_deref().and_then(|path| context.digest(path).ok());
    let key = Key::new(
        "label",
        &(params, &map.crs, map.false_origin, geoid),
        &[ingested.step.key().as_str(), photos.step.key().as_str()],
    );
    context.step(&format!("label-{epoch}"), key, |step, _| {
        let mut store = DiskLabels::new(step.path(), tiles);
        let mask = |image| photos.labels(image);
        let transfer = transfer_labels(tiles, &photos.views, mask, &mut store, params, context.progress)?;
        write_json(&step.file(TRANSFER), &transfer)
    })
}

/// The labels of an epoch, before its stones are tabulated.
pub(super) struct Labels {
    pub(super) transfer: Transfer,
    pub(super) store: DiskLabels,
    /// The step that made them.
    pub(super) step: StepDir,
}

/// Tabulates the stones of an epoch in a step of this name; then moves the points, where the project says so.
pub(super) fn tabulate(run: &Run, epoch: EpochId, name: &str, labels: Labels) -> Result<Labelled> {
    let (context, ingested, photos) = (run.context, run.moved(epoch)?, run.posed(epoch)?);
    let Labels {
        transfer,
        store,
        step: labelled,
    } = labels;
    let params = &context.project.settings.stones;
    // A prescribed motion moves stones by where they are in the reference.
    let motion = context.project.epochs[epoch].motion.as_ref();
    let reference = motion.map(|_| run.voted(EpochId::REFERENCE)).transpose()?;
    let above = [
        labelled.key().as_str(),
        reference.as_ref().map_or("", |r| r.key().as_str()),
    ];
    let key = Key::new("stones", &(params, motion, run.frame(epoch)?), &above);
    let step = context.step(&format!("{name}-{epoch}"), key, |step, _| {
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
        let is_of_views = has_no_photos(context.project, epoch);
        let why = match context.project.part {
            Some(_) => "are there stones in the part of the wall that the run is limited to?",
            None if is_of_views => {
                "the views of its cloud show none: the wall is smooth, or its points lie too far apart (12 distances \
                 between points across a stone are needed); give posed photos"
            }
            None => "do its cameras and clouds share one frame?",
        };
        let name = &context.project.epochs[epoch].name;
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
