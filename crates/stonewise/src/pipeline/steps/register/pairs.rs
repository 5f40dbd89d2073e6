//! Points of matched stones, gathered from the tiles of two epochs into batches of neighbours on disk.

use crate::error::{Error, Result};
use crate::pipeline::steps::label::Labelled;
use crate::storage::spill::{Spill, SpillBins};
use crate::storage::step::StepDir;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::Pair;
use stonewise_core::id::StoneId;
use stonewise_core::progress::Progress;
use stonewise_core::registration::{
    MatchedPair, NearPoint, PairPlaces, PairPoints, PairSource, StoneExtents, Window, stone_points,
};
use stonewise_io::table::{Table, read_columns, write_parquet};

/// Stones in a batch: at 20,000 points an epoch, 30 MB.
const BATCH: usize = 64;
/// Matched pairs whose points lie in one file a batch.
pub struct DiskPairs {
    dir: PathBuf,
    /// All batches are full but the last.
    batches: Vec<Vec<MatchedPair>>,
    /// Where the points of each pair count, per batch.
    windows: Vec<Vec<Option<Arc<Window>>>>,
}

impl DiskPairs {
    /// Gathers the points of the matched stones of two epochs into the step's folder.
    ///
    /// Nearer to the border of a stone than `border_noises` times the noise, points are chosen by their place
    /// instead of by their label, see [`stone_points`].
    pub fn gather(
        labelled: Pair<&Labelled>,
        matches: &[(StoneId, StoneId)],
        border_noises: f64,
        step: &StepDir,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut pairs = Self {
            dir: step.path().to_path_buf(),
            batches: MatchedPair::of_matches(&labelled.first.stones, &labelled.later.stones, matches)
                .chunks(BATCH)
                .map(<[_]>::to_vec)
                .collect(),
            windows: Vec::new(),
        };
        let mut spill = Spill::new(&step.file("spill"), |k: &u32| format!("b{k}"))?;
        let extents = match border_noises > 0.0 {
            true => labelled.first.extents(progress)?,
            false => StoneExtents::default(),
        };
        pairs.spill(labelled.first, 0, &extents, &mut spill, progress)?;
        pairs.spill(labelled.later, 1, &extents, &mut spill, progress)?;
        let bins = spill.finish()?;
        pairs.windows = (0..pairs.batches.len())
            .into_par_iter()
            .map(|b| pairs.write_batch(&bins, b, border_noises))
            .collect::<Result<_>>()?;
        Ok(pairs)
    }

    /// How the stones around each pair of a batch moved, metres.
    pub fn shifts(&self, batch: usize) -> Vec<Vector3<f64>> {
        self.batches[batch].iter().map(|p| p.shift).collect()
    }

    /// Removes the files, which are not needed once the motions are known.
    pub fn remove(self) -> Result<()> {
        (0..self.batches.len()).try_for_each(|batch| {
            let path = self.file(batch);
            fs::remove_file(&path).map_err(Error::io("removing", &path))
        })
    }

    /// Writes the points of a batch: slot, part ([`FIRST`], [`SECOND`], [`NEARBY`]), x, y, z; the windows in
    /// which they count.
    fn write_batch(
        &self,
        bins: &SpillBins<u32>,
        batch: usize,
        border_noises: f64,
    ) -> Result<Vec<Option<Arc<Window>>>> {
        let key = batch as u32;
        let bytes = if bins.keys().contains(&key) {
            bins.read(&key)?
        } else {
            Vec::new()
        };
        let mut near = vec![[Vec::new(), Vec::new()]; self.batches[batch].len()];

        for record in bytes.chunks_exact(RECORD) {
            let (slot, epoch, point) = decode(record);
            near[slot][epoch].push(point);
        }

        let (mut slots, mut parts, mut offsets) = (Vec::new(), Vec::new(), Vec::new());
        let mut windows = Vec::new();
        for (slot, ([one, two], pair)) in near.iter().zip(&self.batches[batch]).enumerate() {
            let chosen = stone_points([one, two], &pair.first.normal, &pair.shift, border_noises);
            windows.push(chosen.window.map(Arc::new));
            let lists = [
                (FIRST, chosen.first),
                (SECOND, chosen.second),
                (NEARBY, chosen.nearby_second),
            ];
            for (part, points) in lists {
                slots.extend(std::iter::repeat_n(slot as u32, points.len()));
                parts.extend(std::iter::repeat_n(part, points.len()));
                offsets.extend(points);
            }
        }

        let mut table = Table::new();
        table.push("slot", "", "index of the pair of stones in its batch", slots)?;
        table.push(
            "part",
            "",
            "0: first epoch, 1: second epoch, 2: second epoch, near the stone",
            parts,
        )?;

        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let values: Vec<f32> = offsets.iter().map(|o: &[f32; 3]| o[axis]).collect();
            table.push(
                name,
                "m",
                "offset of the point from the centroid of its stone in the first epoch",
                values,
            )?;
        }

        write_parquet(&self.file(batch), &table)?;
        Ok(windows)
    }

    fn file(&self, batch: usize) -> PathBuf {
        self.dir.join(format!("pairs-{batch:05}.parquet"))
    }

    /// Sends every point of a matched stone, and every other point in its box, to its batch, relative to the
    /// stone's centroid in the first epoch. `extents`: boxes of the first epoch's stones.
    fn spill(
        &self,
        epoch: &Labelled,
        which: u16,
        extents: &StoneExtents,
        spill: &mut Spill<u32>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let places = PairPlaces::new(&self.batches.concat(), which > 0, extents);
        let tiles = &epoch.ingested.tiles;
        let records = |tile| -> Result<_> {
            let mut records: BTreeMap<u32, Vec<u8>> = BTreeMap::new();
            let labels = epoch.labels(tile)?;
            if places.reach_into(&tiles.bounds(tile)) || labels.stone.iter().any(|s| places.has(*s)) {
                let (cloud, origins) = (tiles.load(tile)?, tiles.surveyed.origins(tile)?);
                for (i, stone) in labels.stone.iter().enumerate() {
                    for (k, near) in places.near(cloud.world(i), *stone) {
                        let (batch, slot) = ((k / BATCH) as u32, (k % BATCH) as u16);
                        let source = origins.source[i];
                        let near = NearPoint { source, ..near };
                        let of_batch = records.entry(batch).or_default();
                        of_batch.extend(encode(slot, which, near));
                    }
                }
            }
            Ok(records)
        };
        let all = 0..tiles.tile_count();
        progress.each_prepared("gather stones", all, records, |_, records| {
            for (batch, records) in &records {
                spill.push(*batch, records)?;
            }
            Ok(())
        })
    }
}

impl PairSource for DiskPairs {
    type Error = Error;

    fn batch_count(&self) -> usize {
        self.batches.len()
    }

    fn load(&self, batch: usize) -> Result<Vec<PairPoints>> {
        let pairs = &self.batches[batch];
        let table = read_columns(&self.file(batch), &["slot", "part", "x", "y", "z"])?;
        let (slot, part) = (table.required::<u32>("slot")?, table.required::<u32>("part")?);
        let (x, y, z) = (
            table.required::<f32>("x")?,
            table.required::<f32>("y")?,
            table.required::<f32>("z")?,
        );
        let mut offsets = vec![[const { Vec::new() }; 3]; pairs.len()];
        for i in 0..slot.len() {
            offsets[slot[i] as usize][part[i] as usize].push([x[i], y[i], z[i]]);
        }
        let loaded = pairs.iter().zip(offsets).zip(&self.windows[batch]);
        let loaded = loaded.map(|((pair, offsets), window)| pair.with_points(offsets, window.clone()));
        Ok(loaded.collect())
    }
}

/// Parts of a stone's points in a batch's file: the first epoch's, the second's, and those near it in the
/// second without its label.
const FIRST: u32 = 0;
const SECOND: u32 = 1;
const NEARBY: u32 = 2;

const RECORD: usize = 16;

/// Bit beside the epoch's number: the point has the label of the stone. The source stands above it.
const LABELLED: u16 = 2;
const SOURCE_SHIFT: u32 = 2;
/// Sources beyond this share its number.
const LAST_SOURCE: u32 = (u16::MAX >> SOURCE_SHIFT) as u32;

fn encode(slot: u16, epoch: u16, point: NearPoint) -> [u8; RECORD] {
    let mut record = [0; RECORD];
    let flags = epoch
        | if point.labelled { LABELLED } else { 0 }
        | (point.source.min(LAST_SOURCE) as u16) << SOURCE_SHIFT;
    record[..2].copy_from_slice(&slot.to_le_bytes());
    record[2..4].copy_from_slice(&flags.to_le_bytes());
    for axis in 0..3 {
        record[4 + 4 * axis..8 + 4 * axis].copy_from_slice(&point.offset[axis].to_le_bytes());
    }
    record
}

fn decode(record: &[u8]) -> (usize, usize, NearPoint) {
    let short = |at: usize| u16::from_le_bytes([record[at], record[at + 1]]);
    let real = |at: usize| f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]);
    let flags = short(2);
    let point = NearPoint {
        offset: [real(4), real(8), real(12)],
        labelled: flags & LABELLED != 0,
        source: u32::from(flags >> SOURCE_SHIFT),
    };
    (usize::from(short(0)), usize::from(flags & 1), point)
}
