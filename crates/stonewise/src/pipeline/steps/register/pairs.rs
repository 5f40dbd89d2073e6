//! Points of matched stones, gathered from the tiles of two epochs into batches of neighbours on disk.

use crate::error::{Error, Result};
use crate::pipeline::steps::label::Labelled;
use crate::storage::spill::{Spill, SpillBins};
use crate::storage::step::StepDir;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::geometry::{Bounds, cell_of};
use stonewise_core::id::StoneId;
use stonewise_core::progress::Progress;
use stonewise_core::registration::{NearPoint, PairPoints, PairSource, Window, local_shifts, stone_points};
use stonewise_core::stone::Stone;
use stonewise_io::table::{Table, read_columns, write_parquet};

/// Stones in a batch: at 20,000 points an epoch, 30 MB.
const BATCH: usize = 64;
/// Edge of the cells by which stones are sorted into neighbourhoods, metres.
const NEIGHBOURHOOD_M: f64 = 4.0;
/// Edge of the cells by which a point finds the stones that it may belong to, metres.
const BOX_CELL_M: f64 = 0.5;
/// The outline of a stone reaches half a point spacing beyond its points, metres.
const BOX_MARGIN_M: f64 = 0.02;

/// Matched pairs whose points lie in one file a batch.
pub struct DiskPairs {
    dir: PathBuf,
    batches: Vec<Vec<Pair>>,
    /// Where the points of each pair count, per batch.
    windows: Vec<Vec<Option<Arc<Window>>>>,
}

/// A matched stone in both epochs.
#[derive(Clone)]
struct Pair {
    first: Stone,
    second: Stone,
    /// How the stones around it moved, metres.
    shift: Vector3<f64>,
}

impl DiskPairs {
    /// Gathers the points of the matched stones of two epochs into the step's folder.
    ///
    /// Nearer to the border of a stone than `border_noises` times the noise, points are chosen by their place instead of by their
    /// label, see [`stone_points`].
    pub fn gather(
        first: &Labelled,
        second: &Labelled,
        matches: &[(StoneId, StoneId)],
        border_noises: f64,
        step: &StepDir,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut pairs = Self {
            dir: step.path().to_path_buf(),
            batches: batches(first, second, matches),
            windows: Vec::new(),
        };
        let mut spill = Spill::new(&step.file("spill"), |k: &u32| format!("b{k}"))?;
        let extents = match border_noises > 0.0 {
            true => first.extents(progress)?,
            false => BTreeMap::new(),
        };
        pairs.spill(first, 0, &extents, &mut spill, progress)?;
        pairs.spill(second, 1, &extents, &mut spill, progress)?;
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

    /// Removes the files: once the motions are known nobody needs them.
    pub fn remove(self) -> Result<()> {
        (0..self.batches.len()).try_for_each(|batch| {
            let path = self.file(batch);
            fs::remove_file(&path).map_err(Error::io("removing", &path))
        })
    }

    /// Writes the points of a batch: slot, part ([`FIRST`], [`SECOND`], [`NEARBY`]), x, y, z; the windows in which they count.
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
        table.push("slot", slots)?;
        table.push("part", parts)?;
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            table.push(
                name,
                offsets.iter().map(|o: &[f32; 3]| o[axis]).collect::<Vec<f32>>(),
            )?;
        }
        write_parquet(&self.file(batch), &table)?;
        Ok(windows)
    }

    fn file(&self, batch: usize) -> PathBuf {
        self.dir.join(format!("pairs-{batch:05}.parquet"))
    }

    /// Sends every point of a matched stone, and every other point in its box, to its batch, relative to the stone's centroid in the
    /// first epoch. `extents`: boxes of the first epoch's stones.
    fn spill(
        &self,
        epoch: &Labelled,
        which: u16,
        extents: &BTreeMap<u32, Bounds>,
        spill: &mut Spill<u32>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let (places, of_stone) = self.places(which, extents);
        let cells = by_cell(&places);
        progress.begin("gather stones", epoch.ingested.tiles.tile_count() as u64);
        for tile in 0..epoch.ingested.tiles.tile_count() {
            progress.check()?;
            let bounds = epoch.ingested.tiles.bounds(tile);
            let labels = epoch.labels(tile)?;
            let concerns = |p: &Place| p.extent.is_some_and(|e| e.intersects(&bounds));
            if places.iter().any(concerns) || labels.stone.iter().any(|s| of_stone.contains_key(s)) {
                let cloud = epoch.ingested.tiles.load(tile)?;
                for (i, stone) in labels.stone.iter().enumerate() {
                    let point = cloud.world(i);
                    let own = of_stone.get(stone).copied();
                    let others = cells.get(&cell_of(&point, BOX_CELL_M)).into_iter().flatten();
                    let others = others
                        .copied()
                        .filter(|&k| Some(k) != own && places[k].extent.is_some_and(|e| e.contains(&point)));
                    for k in own.into_iter().chain(others) {
                        let place = &places[k];
                        let near = NearPoint {
                            offset: (point - place.centre).cast::<f32>().into(),
                            labelled: Some(k) == own,
                        };
                        spill.push(place.batch, &encode(place.slot, which, near))?;
                    }
                }
            }
            progress.advance(1);
        }
        Ok(())
    }

    /// Where the matched stones lie in an epoch, and which place is that of which of its stones.
    fn places(&self, which: u16, extents: &BTreeMap<u32, Bounds>) -> (Vec<Place>, BTreeMap<u32, usize>) {
        let (mut places, mut of_stone) = (Vec::new(), BTreeMap::new());
        for (batch, pairs) in self.batches.iter().enumerate() {
            for (slot, pair) in pairs.iter().enumerate() {
                let (stone, shift) = match which {
                    0 => (pair.first.id, Vector3::zeros()),
                    _ => (pair.second.id, pair.shift),
                };
                of_stone.insert(stone.0, places.len());
                places.push(Place {
                    batch: batch as u32,
                    slot: slot as u16,
                    centre: pair.first.centroid,
                    extent: extents
                        .get(&pair.first.id.0)
                        .map(|e| e.grown(BOX_MARGIN_M).moved(&shift)),
                });
            }
        }
        (places, of_stone)
    }
}

/// Where a matched stone lies in an epoch, and where its points go.
struct Place {
    batch: u32,
    slot: u16,
    /// What its points are relative to: its centroid in the first epoch.
    centre: Point3<f64>,
    /// Box in which all points are of interest; `None`: labelled ones only.
    extent: Option<Bounds>,
}

/// Places by the cells that their boxes touch.
fn by_cell(places: &[Place]) -> BTreeMap<[i64; 3], Vec<usize>> {
    let mut cells: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (k, place) in places.iter().enumerate() {
        let Some(extent) = &place.extent else { continue };
        let (low, high) = (cell_of(&extent.min, BOX_CELL_M), cell_of(&extent.max, BOX_CELL_M));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    cells.entry([x, y, z]).or_default().push(k);
                }
            }
        }
    }
    cells
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
        let loaded = loaded.map(|((pair, offsets), window)| {
            let [points_first, points_second, nearby_second] =
                offsets.map(|o| Cloud::new(pair.first.centroid, o));
            PairPoints {
                first: pair.first.id,
                second: pair.second.id,
                centroid: pair.first.centroid,
                centroid_second: pair.second.centroid,
                normal: pair.first.normal,
                points_first,
                points_second,
                nearby_second,
                window: window.clone(),
            }
        });
        Ok(loaded.collect())
    }
}

/// Pairs in batches of neighbours: sorted by the cell of the first centroid, then by stone.
fn batches(first: &Labelled, second: &Labelled, matches: &[(StoneId, StoneId)]) -> Vec<Vec<Pair>> {
    let by_id = |epoch: &Labelled| {
        epoch
            .stones
            .iter()
            .map(|s| (s.id, s.clone()))
            .collect::<BTreeMap<_, _>>()
    };
    let (ones, twos) = (by_id(first), by_id(second));
    let found: Vec<(Stone, Stone)> = matches
        .iter()
        .filter_map(|(a, b)| Some((ones.get(a)?.clone(), twos.get(b)?.clone())))
        .collect();
    let centroids: Vec<Point3<f64>> = found.iter().map(|(a, _)| a.centroid).collect();
    let moved: Vec<Vector3<f64>> = found.iter().map(|(a, b)| b.centroid - a.centroid).collect();
    let mut pairs: Vec<Pair> = found
        .into_iter()
        .zip(local_shifts(&centroids, &moved))
        .map(|((first, second), shift)| Pair { first, second, shift })
        .collect();
    pairs.sort_by_key(|p| (cell_of(&p.first.centroid, NEIGHBOURHOOD_M), p.first.id));
    pairs.chunks(BATCH).map(<[_]>::to_vec).collect()
}

/// Parts of a stone's points in a batch's file: the first epoch's, the second's, and those near it in the second without its label.
const FIRST: u32 = 0;
const SECOND: u32 = 1;
const NEARBY: u32 = 2;

const RECORD: usize = 16;

/// Bit beside the epoch's number: the point has the label of the stone.
const LABELLED: u16 = 2;

fn encode(slot: u16, epoch: u16, point: NearPoint) -> [u8; RECORD] {
    let mut record = [0; RECORD];
    let flags = epoch | if point.labelled { LABELLED } else { 0 };
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
    };
    (usize::from(short(0)), usize::from(flags & !LABELLED), point)
}
