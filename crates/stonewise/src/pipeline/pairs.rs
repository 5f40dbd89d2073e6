//! Points of matched stones, gathered from the tiles of two epochs into batches of neighbours on disk.

use crate::error::{Error, Result};
use crate::pipeline::label::Labelled;
use crate::pipeline::spill::{Spill, SpillBins};
use crate::pipeline::step::StepDir;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::id::StoneId;
use stonewise_core::progress::Progress;
use stonewise_core::registration::{PairPoints, PairSource, inner_points};
use stonewise_core::stone::Stone;
use stonewise_io::table::{Table, read_columns, write_parquet};

/// Stones in a batch: at 20,000 points an epoch, 30 MB.
const BATCH: usize = 64;
/// Edge of the cells by which stones are sorted into neighbourhoods, metres.
const NEIGHBOURHOOD_M: f64 = 4.0;

/// Matched pairs whose points lie in one file a batch.
pub struct DiskPairs {
    dir: PathBuf,
    batches: Vec<Vec<(Stone, Stone)>>,
}

impl DiskPairs {
    /// Gathers the points of the matched stones of two epochs into the step's folder.
    ///
    /// Points nearer to the border of their stone than `border_noises` times the noise are left out, see [`inner_points`].
    pub fn gather(
        first: &Labelled,
        second: &Labelled,
        matches: &[(StoneId, StoneId)],
        border_noises: f64,
        step: &StepDir,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let pairs = Self {
            dir: step.path().to_path_buf(),
            batches: batches(first, second, matches),
        };
        let mut spill = Spill::new(&step.file("spill"), |k: &u32| format!("b{k}"))?;
        pairs.spill(first, 0, &mut spill, progress)?;
        pairs.spill(second, 1, &mut spill, progress)?;
        let bins = spill.finish()?;
        (0..pairs.batches.len())
            .into_par_iter()
            .try_for_each(|b| pairs.write_batch(&bins, b, border_noises))?;
        Ok(pairs)
    }

    /// Removes the files: once the motions are known nobody needs them.
    pub fn remove(self) -> Result<()> {
        (0..self.batches.len()).try_for_each(|batch| {
            let path = self.file(batch);
            fs::remove_file(&path).map_err(Error::io("removing", &path))
        })
    }

    /// Writes the points of a batch: slot, epoch (0 or 1), x, y, z.
    fn write_batch(&self, bins: &SpillBins<u32>, batch: usize, border_noises: f64) -> Result<()> {
        let key = batch as u32;
        let bytes = if bins.keys().contains(&key) {
            bins.read(&key)?
        } else {
            Vec::new()
        };
        let mut points = vec![[Vec::new(), Vec::new()]; self.batches[batch].len()];
        for record in bytes.chunks_exact(RECORD) {
            let (slot, epoch, offset) = decode(record);
            points[slot][epoch].push(offset);
        }
        let (mut slots, mut epochs, mut offsets) = (Vec::new(), Vec::new(), Vec::new());
        for (slot, (of_stone, (stone, _))) in points.into_iter().zip(&self.batches[batch]).enumerate() {
            for (epoch, of_epoch) in of_stone.into_iter().enumerate() {
                let inner = if border_noises > 0.0 {
                    inner_points(of_epoch, &stone.normal, border_noises)
                } else {
                    of_epoch
                };
                slots.extend(std::iter::repeat_n(slot as u32, inner.len()));
                epochs.extend(std::iter::repeat_n(epoch as u32, inner.len()));
                offsets.extend(inner);
            }
        }
        let mut table = Table::new();
        table.push("slot", slots)?;
        table.push("epoch", epochs)?;
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            table.push(
                name,
                offsets.iter().map(|o: &[f32; 3]| o[axis]).collect::<Vec<f32>>(),
            )?;
        }
        Ok(write_parquet(&self.file(batch), &table)?)
    }

    fn file(&self, batch: usize) -> PathBuf {
        self.dir.join(format!("pairs-{batch:05}.parquet"))
    }

    /// Sends every point of a matched stone to its batch, relative to the stone's centroid in the first epoch.
    fn spill(
        &self,
        epoch: &Labelled,
        which: u16,
        spill: &mut Spill<u32>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let mut places = BTreeMap::new();
        for (batch, pairs) in self.batches.iter().enumerate() {
            for (slot, pair) in pairs.iter().enumerate() {
                let stone = if which == 0 { pair.0.id } else { pair.1.id };
                places.insert(stone.0, (batch as u32, slot as u16, pair.0.centroid));
            }
        }
        progress.begin("gather stones", epoch.tiled.tiles.tile_count() as u64);
        for tile in 0..epoch.tiled.tiles.tile_count() {
            progress.check()?;
            let labels = epoch.labels(tile)?;
            if labels.stone.iter().any(|s| places.contains_key(s)) {
                let cloud = epoch.tiled.tiles.load(tile)?;
                for (i, stone) in labels.stone.iter().enumerate() {
                    if let Some((batch, slot, centre)) = places.get(stone) {
                        let offset = (cloud.world(i) - centre).cast::<f32>();
                        spill.push(*batch, &encode(*slot, which, [offset.x, offset.y, offset.z]))?;
                    }
                }
            }
            progress.advance(1);
        }
        Ok(())
    }
}

impl PairSource for DiskPairs {
    type Error = Error;

    fn batch_count(&self) -> usize {
        self.batches.len()
    }

    fn load(&self, batch: usize) -> Result<Vec<PairPoints>> {
        let pairs = &self.batches[batch];
        let table = read_columns(&self.file(batch), &["slot", "epoch", "x", "y", "z"])?;
        let (slot, epoch) = (table.required::<u32>("slot")?, table.required::<u32>("epoch")?);
        let (x, y, z) = (
            table.required::<f32>("x")?,
            table.required::<f32>("y")?,
            table.required::<f32>("z")?,
        );
        let mut offsets = vec![[Vec::new(), Vec::new()]; pairs.len()];
        for i in 0..slot.len() {
            offsets[slot[i] as usize][epoch[i] as usize].push([x[i], y[i], z[i]]);
        }
        let loaded = pairs
            .iter()
            .zip(offsets)
            .map(|((a, b), [first, second])| PairPoints {
                first: a.id,
                second: b.id,
                centroid: a.centroid,
                centroid_second: b.centroid,
                normal: a.normal,
                points_first: Cloud::new(a.centroid, first),
                points_second: Cloud::new(a.centroid, second),
            });
        Ok(loaded.collect())
    }
}

/// Pairs in batches of neighbours: sorted by the cell of the first centroid, then by stone.
fn batches(first: &Labelled, second: &Labelled, matches: &[(StoneId, StoneId)]) -> Vec<Vec<(Stone, Stone)>> {
    let by_id = |epoch: &Labelled| {
        epoch
            .stones
            .iter()
            .map(|s| (s.id, s.clone()))
            .collect::<BTreeMap<_, _>>()
    };
    let (ones, twos) = (by_id(first), by_id(second));
    let mut pairs: Vec<(Stone, Stone)> = matches
        .iter()
        .filter_map(|(a, b)| Some((ones.get(a)?.clone(), twos.get(b)?.clone())))
        .collect();
    let cell = |stone: &Stone| [0, 1, 2].map(|a| (stone.centroid[a] / NEIGHBOURHOOD_M).floor() as i64);
    pairs.sort_by_key(|(a, _)| (cell(a), a.id));
    pairs.chunks(BATCH).map(<[_]>::to_vec).collect()
}

const RECORD: usize = 16;

fn encode(slot: u16, epoch: u16, offset: [f32; 3]) -> [u8; RECORD] {
    let mut record = [0; RECORD];
    record[..2].copy_from_slice(&slot.to_le_bytes());
    record[2..4].copy_from_slice(&epoch.to_le_bytes());
    for axis in 0..3 {
        record[4 + 4 * axis..8 + 4 * axis].copy_from_slice(&offset[axis].to_le_bytes());
    }
    record
}

fn decode(record: &[u8]) -> (usize, usize, [f32; 3]) {
    let short = |at: usize| usize::from(u16::from_le_bytes([record[at], record[at + 1]]));
    let real = |at: usize| f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]);
    (short(0), short(2), [real(4), real(8), real(12)])
}
