//! The labels of an epoch in batches of tiles, for processes that share the step `label`.
//!
//! `prepare` keeps what all batches need; each batch labels its tiles; the step itself gathers them. The
//! files are those that one process makes, to the byte.

use super::disk_labels::DiskLabels;
use super::step_key::{label_key, label_name};
use crate::error::{Error, Result};
use crate::files::read_bytes;
use crate::pipeline::context::Context;
use crate::pipeline::part::Part;
use crate::pipeline::steps::ingest::Ingested;
use crate::pipeline::steps::segment::Segmented;
use crate::storage::step::{Key, StepDir};
use crate::storage::tiles::DiskTiles;
use std::path::{Path, PathBuf};
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::EpochId;
use stonewise_core::transfer::{Election, KeptParts, Occupancy, PreparedTransfer, Transfer, finish_transfer};
use stonewise_io::atomic::write_atomically;

/// The decisions about instances, in its folder.
const ELECTION: &str = "election";
/// Where the stones of a batch are, in its folder.
const OCCUPANCY: &str = "occupancy";

/// The step `label` of an epoch in this number of batches.
pub struct LabelBatches<'a> {
    context: &'a Context<'a>,
    ingested: &'a Ingested,
    photos: &'a Segmented,
    count: usize,
    name: String,
    key: Key,
}

impl<'a> LabelBatches<'a> {
    /// The batches of an epoch.
    pub fn new(
        context: &'a Context<'a>,
        epoch: EpochId,
        ingested: &'a Ingested,
        photos: &'a Segmented,
        count: usize,
    ) -> Self {
        Self {
            context,
            ingested,
            photos,
            count,
            name: label_name(epoch),
            key: label_key(context, epoch, ingested, photos),
        }
    }

    /// Makes depth maps, and decides about the instances of all photos.
    pub fn prepare(&self) -> Result<StepDir> {
        self.part(Part::Prepare, |part| {
            let (tiles, params) = (self.tiles(), &self.context.project.settings.label);
            let mask = |image| self.photos.labels(image).map(Some);
            let views = &self.photos.views;
            let prepared = PreparedTransfer::new(tiles, views, mask, params, self.context.progress)?;
            for photo in 0..prepared.photo_count() {
                write_bytes(
                    &depth_file(part, photo),
                    &prepared.depth(photo).unwrap_or_default(),
                )?;
            }
            for tile in 0..tiles.tile_count() {
                write_bytes(
                    &surface_file(part, tile),
                    &prepared.surface(tile).unwrap_or_default(),
                )?;
            }
            write_bytes(&part.file(ELECTION), &prepared.election().encode())
        })
    }

    /// Labels the tiles of one batch, counted from 0.
    pub fn batch(&self, number: usize) -> Result<StepDir> {
        self.part(Part::Tiles(number, self.count), |part| {
            let (tiles, params) = (self.tiles(), &self.context.project.settings.label);
            let kept = self.prepare()?;
            let range = tiles.batch(number, self.count);
            let mask = |image| self.photos.labels(image).map(Some);
            let views = &self.photos.views;
            let election = election(&kept)?;
            let prepared =
                PreparedTransfer::restore(tiles, &range, views, election, &OnDisk(&kept), mask, params)?;
            let mut store = DiskLabels::new(part.path(), tiles);
            let occupancy = prepared.label(tiles, range, &mut store, self.context.progress)?;
            write_bytes(&part.file(OCCUPANCY), &occupancy.encode())
        })
    }

    /// Takes the labels of all batches into the folder of the step, and islands out of them.
    pub fn gather(&self, step: &StepDir) -> Result<Transfer> {
        let (tiles, params) = (self.tiles(), &self.context.project.settings.label);
        let mut all: Option<Occupancy> = None;
        for number in 0..self.count {
            let part = self.batch(number)?;
            for tile in tiles.batch(number, self.count) {
                let file = DiskLabels::file_name(tiles, tile);
                step.take(&part, &file, &file)?;
            }
            let occupancy = Occupancy::decode(&read_bytes(&part.file(OCCUPANCY))?)?;
            match &mut all {
                Some(all) => all.merge(occupancy),
                None => all = Some(occupancy),
            }
        }
        let election = election(&self.prepare()?)?;
        let mut store = DiskLabels::new(step.path(), tiles);
        let views = &self.photos.views;
        let occupancy = all.unwrap_or_else(|| Occupancy::new(params.island_link_m));
        Ok(finish_transfer(
            tiles,
            views,
            &election,
            occupancy,
            &mut store,
            params,
            self.context.progress,
        )?)
    }

    fn part(&self, part: Part, make: impl FnOnce(&StepDir) -> Result<()>) -> Result<StepDir> {
        self.context.part((&self.name, &self.key), &part.name(), make)
    }

    fn tiles(&self) -> &DiskTiles {
        &self.ingested.tiles.surveyed
    }
}

fn election(kept: &StepDir) -> Result<Election> {
    Ok(Election::decode(&read_bytes(&kept.file(ELECTION))?)?)
}

struct OnDisk<'a>(&'a StepDir);

impl KeptParts for OnDisk<'_> {
    type Error = Error;

    fn depth(&self, photo: usize) -> Result<Vec<u8>> {
        read_bytes(&depth_file(self.0, photo))
    }

    fn surface(&self, tile: usize) -> Result<Vec<u8>> {
        read_bytes(&surface_file(self.0, tile))
    }
}

fn depth_file(step: &StepDir, photo: usize) -> PathBuf {
    step.file(format!("depth-{photo:05}"))
}

fn surface_file(step: &StepDir, tile: usize) -> PathBuf {
    step.file(format!("surface-{tile:05}"))
}

fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomically(path, |partial| std::fs::write(partial, bytes)).map_err(Error::io("writing", path))
}
