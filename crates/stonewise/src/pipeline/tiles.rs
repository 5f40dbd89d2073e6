//! An epoch's cloud on disk, cut into cubic tiles.
//!
//! Each tile is a Parquet file of x, y, z (f32 offsets from the tile's origin, metres), file (which of the
//! epoch's clouds) and index (which record of it). `tiles.json` lists origins, bounds and counts.

use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::spill::Spill;
use crate::pipeline::step::StepDir;
use nalgebra::Point3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::geometry::{Bounds, cell_of};
use stonewise_core::progress::Progress;
use stonewise_io::cloud::{cloud_info, read_cloud};
use stonewise_io::table::{Table, read_columns, write_parquet};

/// Points read from a cloud file at a time.
const CHUNK: usize = 1 << 20;
/// Tiles kept in memory by a [`DiskTiles`]: a tile and its neighbours are asked for again and again.
const CACHED_TILES: usize = 12;

#[derive(Clone, Debug, Serialize, Deserialize)]
struct TileEntry {
    name: String,
    origin: Point3<f64>,
    bounds: Bounds,
    points: u64,
}

/// Where each point of a tile came from.
pub struct Provenance {
    /// Which of the epoch's clouds.
    pub file: Vec<u32>,
    /// Which record of that cloud, from 0.
    pub index: Vec<u64>,
}

/// The tiles of one epoch, read when asked for.
pub struct DiskTiles {
    dir: PathBuf,
    tiles: Vec<TileEntry>,
    cache: Mutex<VecDeque<(usize, Arc<Cloud>)>>,
}

impl DiskTiles {
    /// Opens the tiles that [`ingest`] wrote.
    pub fn open(dir: &Path) -> Result<Self> {
        let tiles = read_json(&dir.join("tiles.json"))?;
        Ok(Self {
            dir: dir.to_path_buf(),
            tiles,
            cache: Mutex::new(VecDeque::new()),
        })
    }

    /// Number of points in all tiles.
    pub fn point_count(&self) -> u64 {
        self.tiles.iter().map(|t| t.points).sum()
    }

    /// File-name stem of a tile, for files that go beside it.
    pub fn name(&self, tile: usize) -> &str {
        &self.tiles[tile].name
    }

    /// Where the points of a tile came from, in the order of its points.
    pub fn provenance(&self, tile: usize) -> Result<Provenance> {
        let path = self.dir.join(format!("{}.parquet", self.tiles[tile].name));
        let table = read_columns(&path, &["file", "index"])?;
        Ok(Provenance {
            file: table.required("file")?.to_vec(),
            index: table.required("index")?.to_vec(),
        })
    }
}

impl TileSource for DiskTiles {
    type Error = Error;

    fn tile_count(&self) -> usize {
        self.tiles.len()
    }

    fn bounds(&self, tile: usize) -> Bounds {
        self.tiles[tile].bounds
    }

    fn load(&self, tile: usize) -> Result<Cloud> {
        let cached = |queue: &VecDeque<(usize, Arc<Cloud>)>| {
            queue.iter().find(|e| e.0 == tile).map(|e| Arc::clone(&e.1))
        };
        if let Some(cloud) = cached(&self.cache.lock().unwrap_or_else(PoisonError::into_inner)) {
            return Ok((*cloud).clone());
        }
        let entry = &self.tiles[tile];
        let table = read_columns(
            &self.dir.join(format!("{}.parquet", entry.name)),
            &["x", "y", "z"],
        )?;
        let (x, y, z) = (
            table.required::<f32>("x")?,
            table.required("y")?,
            table.required("z")?,
        );
        let offsets = x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z]).collect();
        let cloud = Arc::new(Cloud::new(entry.origin, offsets));
        let mut queue = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        queue.push_back((tile, Arc::clone(&cloud)));
        if queue.len() > CACHED_TILES {
            queue.pop_front();
        }
        Ok((*cloud).clone())
    }
}

/// Cuts clouds into tiles in one streaming pass; points of a tile keep the order of files and records.
///
/// `size_m`: edge of a tile, metres. Points that do not take part are in no tile. Returns the number of records without finite coordinates, which no tile holds.
pub fn ingest(
    clouds: &[PathBuf],
    size_m: f64,
    takes_part: impl Fn(&Point3<f64>) -> bool,
    step: &StepDir,
    progress: &dyn Progress,
) -> Result<u64> {
    let mut spill = Spill::new(&step.file("spill"), |k: &[i64; 3]| {
        format!("t_{}_{}_{}", k[0], k[1], k[2])
    })?;
    let mut invalid = 0;
    for (file, path) in clouds.iter().enumerate() {
        let records = cloud_info(path)?.records;
        progress.begin(
            &format!(
                "ingest {}",
                path.file_name().unwrap_or_default().to_string_lossy()
            ),
            records,
        );
        let summary = read_cloud(path, CHUNK, |chunk| {
            progress.check()?;
            let taken = chunk
                .positions
                .iter()
                .zip(&chunk.indices)
                .filter(|(p, _)| takes_part(p));
            for (p, &index) in taken {
                let key = cell_of(p, size_m);
                spill.push(key, &encode(p, &tile_origin(&key, size_m), file as u32, index))?;
            }
            progress.advance(chunk.len() as u64);
            Ok::<(), Error>(())
        })?;
        invalid += summary.skipped;
    }
    let bins = spill.finish()?;
    progress.begin("sort tiles", bins.keys().len() as u64);
    let entries = bins
        .keys()
        .par_iter()
        .map(|key| {
            progress.check()?;
            let (cloud, file, index) = decode(&bins.read(key)?, tile_origin(key, size_m));
            let entry = write_tile(
                step,
                &format!("{}_{}_{}", key[0], key[1], key[2]),
                &cloud,
                file,
                index,
            )?;
            progress.advance(1);
            Ok(entry)
        })
        .collect::<Result<Vec<_>>>()?;
    write_index(step, &entries)?;
    Ok(invalid)
}

/// Middle of the tile, so that offsets stay small.
fn tile_origin(key: &[i64; 3], size_m: f64) -> Point3<f64> {
    Point3::from(key.map(|k| (k as f64 + 0.5) * size_m))
}

const RECORD: usize = 24;

fn encode(p: &Point3<f64>, origin: &Point3<f64>, file: u32, index: u64) -> [u8; RECORD] {
    let mut record = [0; RECORD];
    let offset = (p - origin).cast::<f32>();
    for axis in 0..3 {
        record[4 * axis..4 * axis + 4].copy_from_slice(&offset[axis].to_le_bytes());
    }
    record[12..16].copy_from_slice(&file.to_le_bytes());
    record[16..].copy_from_slice(&index.to_le_bytes());
    record
}

fn decode(bytes: &[u8], origin: Point3<f64>) -> (Cloud, Vec<u32>, Vec<u64>) {
    let word = |r: &[u8], at: usize| [r[at], r[at + 1], r[at + 2], r[at + 3]];
    let records = bytes.chunks_exact(RECORD);
    let offsets = records
        .clone()
        .map(|r| [0, 4, 8].map(|at| f32::from_le_bytes(word(r, at))))
        .collect();
    let file = records.clone().map(|r| u32::from_le_bytes(word(r, 12))).collect();
    let index = records.map(|r| {
        u64::from(u32::from_le_bytes(word(r, 16))) | u64::from(u32::from_le_bytes(word(r, 20))) << 32
    });
    (Cloud::new(origin, offsets), file, index.collect())
}

fn write_tile(
    step: &StepDir,
    name: &str,
    cloud: &Cloud,
    file: Vec<u32>,
    index: Vec<u64>,
) -> Result<TileEntry> {
    let mut table = Table::new();
    for (axis, column) in ["x", "y", "z"].into_iter().enumerate() {
        table.push(
            column,
            cloud.offsets().iter().map(|o| o[axis]).collect::<Vec<f32>>(),
        )?;
    }
    table.push("file", file)?;
    table.push("index", index)?;
    write_parquet(&step.file(format!("{name}.parquet")), &table)?;
    let points = (0..cloud.len()).map(|i| cloud.world(i));
    let origin = cloud.origin();
    let bounds = Bounds::of(points).unwrap_or(Bounds {
        min: origin,
        max: origin,
    });
    Ok(TileEntry {
        name: name.to_owned(),
        origin,
        bounds,
        points: cloud.len() as u64,
    })
}

fn write_index(step: &StepDir, entries: &[TileEntry]) -> Result<()> {
    write_json(&step.file("tiles.json"), &entries)
}
