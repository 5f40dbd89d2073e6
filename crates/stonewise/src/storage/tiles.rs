//! An epoch's cloud on disk, cut into cubic tiles.
//!
//! Each tile is a Parquet file of x, y, z (f32 offsets from the tile's origin, metres), file (which of the
//! epoch's clouds), index (which record of it), source (which entry of `sources.json`) and time (seconds
//! since that source's first point). Tiles of an epoch with views have red, green, blue and intensity,
//! too. `tiles.json` lists origins, bounds and counts.

use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::sources::{PointSource, RawSource, SourceList, SourceRule};
use crate::storage::spill::Spill;
use crate::storage::step::StepDir;
use nalgebra::Point3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::geometry::{Bounds, Rigid3, cell_of};
use stonewise_core::progress::Progress;
use stonewise_core::views::PointValues;
use stonewise_io::cloud::{PointChunk, ReadSummary, claimed_records, read_cloud};
use stonewise_io::table::{Table, read_columns, write_parquet};

/// File of the epoch's sources.
const SOURCES: &str = "sources.json";
/// Points read from a cloud file at a time.
const CHUNK: usize = 1 << 20;
/// Points of a chunk that one thread sorts into tiles at a time.
const PART: usize = 1 << 15;
/// Tiles kept in memory by a [`DiskTiles`]: a tile and its neighbours are read again and again.
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

/// The tiles of one epoch, read when they are used.
pub struct DiskTiles {
    dir: PathBuf,
    tiles: Vec<TileEntry>,
    /// Brings the points into another frame.
    frame: Option<Rigid3>,
    cache: Mutex<VecDeque<(usize, Arc<Cloud>)>>,
}

impl Clone for DiskTiles {
    /// The same tiles, none of them in memory yet.
    fn clone(&self) -> Self {
        Self {
            dir: self.dir.clone(),
            tiles: self.tiles.clone(),
            frame: self.frame,
            cache: Mutex::default(),
        }
    }
}

impl DiskTiles {
    /// Opens the tiles that [`cut_into_tiles`] wrote.
    pub fn open(dir: &Path) -> Result<Self> {
        let tiles = read_json(&dir.join("tiles.json"))?;
        Ok(Self {
            dir: dir.to_path_buf(),
            tiles,
            frame: None,
            cache: Mutex::new(VecDeque::new()),
        })
    }

    /// These tiles with every point moved by `frame`; their order, names and provenance stay.
    pub fn in_frame(&self, frame: &Rigid3) -> Self {
        Self {
            frame: Some(*frame),
            ..self.clone()
        }
    }

    /// Number of points in all tiles.
    pub fn point_count(&self) -> u64 {
        self.tiles.iter().map(|t| t.points).sum()
    }

    /// File-name stem of a tile, for files that go beside it.
    pub fn name(&self, tile: usize) -> &str {
        &self.tiles[tile].name
    }

    fn columns(&self, tile: usize, names: &[&str]) -> Result<Table> {
        let path = self.dir.join(format!("{}.parquet", self.tiles[tile].name));
        Ok(read_columns(&path, names)?)
    }

    /// Where the points of a tile came from, in the order of its points.
    pub fn provenance(&self, tile: usize) -> Result<Provenance> {
        let table = self.columns(tile, &["file", "index"])?;
        Ok(Provenance {
            file: table.required("file")?.to_vec(),
            index: table.required("index")?.to_vec(),
        })
    }
}

/// Origin of each point of a tile: its number in the epoch's list of sources, and its time since that source began,
/// seconds.
pub struct TileOrigins {
    /// Entry of `sources.json`.
    pub source: Vec<u32>,
    /// Seconds.
    pub time_s: Vec<f32>,
}

impl DiskTiles {
    /// The epoch's sources, as its files number them.
    pub fn raw_sources(&self) -> Result<Vec<RawSource>> {
        read_json(&self.dir.join(SOURCES))
    }

    /// Source and time of the points of a tile, in the order of its points.
    pub fn origins(&self, tile: usize) -> Result<TileOrigins> {
        let table = self.columns(tile, &["source", "time"])?;
        Ok(TileOrigins {
            source: table.required("source")?.to_vec(),
            time_s: table.required("time")?.to_vec(),
        })
    }
}

impl TileSource for DiskTiles {
    type Error = Error;

    fn tile_count(&self) -> usize {
        self.tiles.len()
    }

    fn bounds(&self, tile: usize) -> Bounds {
        let bounds = self.tiles[tile].bounds;
        let moved = self
            .frame
            .and_then(|frame| Bounds::of(bounds.corners().map(|c| frame * c)));
        moved.unwrap_or(bounds)
    }

    fn load(&self, tile: usize) -> Result<Cloud> {
        let cached = |queue: &VecDeque<(usize, Arc<Cloud>)>| {
            queue.iter().find(|e| e.0 == tile).map(|e| Arc::clone(&e.1))
        };
        let found = cached(&self.cache.lock().unwrap_or_else(PoisonError::into_inner));
        if let Some(cloud) = found {
            return Ok((*cloud).clone());
        }
        let table = self.columns(tile, &["x", "y", "z"])?;
        let (x, y, z) = (
            table.required::<f32>("x")?,
            table.required("y")?,
            table.required("z")?,
        );

        let offsets = x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z]).collect();
        let cloud = Cloud::new(self.tiles[tile].origin, offsets);
        let cloud = Arc::new(match &self.frame {
            Some(frame) => Cloud::from_world(
                frame * cloud.origin(),
                (0..cloud.len()).map(|i| frame * cloud.world(i)),
            ),
            None => cloud,
        });
        let mut queue = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        queue.push_back((tile, Arc::clone(&cloud)));
        if queue.len() > CACHED_TILES {
            queue.pop_front();
        }

        Ok((*cloud).clone())
    }
}

/// Colours and intensities of the points of a tile, in their order.
pub struct TileValues {
    colours: Vec<[u16; 3]>,
    intensities: Vec<f32>,
    sources: Vec<u32>,
}

impl TileValues {
    /// The values as references, as stonewise-core takes them.
    pub fn borrowed(&self) -> PointValues<'_> {
        PointValues {
            colours: &self.colours,
            intensities: &self.intensities,
            sources: &self.sources,
        }
    }
}

impl DiskTiles {
    /// Colours and intensities of the points of a tile, of an epoch whose tiles keep them.
    pub fn values(&self, tile: usize) -> Result<TileValues> {
        let table = self.columns(tile, &["red", "green", "blue", "intensity", "source"])?;
        let [red, green, blue]: [&[u16]; 3] = [
            table.required("red")?,
            table.required("green")?,
            table.required("blue")?,
        ];
        let colours = red.iter().zip(green).zip(blue);
        Ok(TileValues {
            colours: colours.map(|((&r, &g), &b)| [r, g, b]).collect(),
            intensities: table.required("intensity")?.to_vec(),
            sources: table.required("source")?.to_vec(),
        })
    }
}

/// What tiles keep of the points of an epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Keeps {
    /// Where they are and where they come from.
    Places,
    /// Their colours and intensities, too.
    Values,
}

impl Keeps {
    /// Length of a [`Record`].
    fn record_bytes(self) -> usize {
        match self {
            Self::Places => PLACE_BYTES,
            Self::Values => PLACE_BYTES + VALUE_BYTES,
        }
    }
}

/// Cuts clouds into tiles in one streaming pass; points of a tile keep the order of files and records.
///
/// `size_m`: edge of a tile, metres. Points that do not take part are in no tile. Returns how many records there are, and
/// how many of them no tile holds because they have no finite coordinates, are withheld or noise.
pub fn cut_into_tiles(
    clouds: &[PathBuf],
    rule: SourceRule,
    size_m: f64,
    (keeps, takes_part): (Keeps, impl Fn(&Point3<f64>) -> bool + Sync),
    step: &StepDir,
    progress: &dyn Progress,
) -> Result<ReadSummary> {
    let mut spill = Spill::new(&step.file("spill"), |k: &[i64; 3]| {
        format!("t_{}_{}_{}", k[0], k[1], k[2])
    })?;
    let mut summary = ReadSummary::default();
    let mut sources = SourceList::new(rule);
    let records = clouds
        .iter()
        .map(|c| most_records(c))
        .collect::<Result<Vec<u64>>>()?;
    let mut occupied = OccupiedTiles::new(records.iter().sum(), size_m);

    for (file, (path, &records)) in clouds.iter().zip(&records).enumerate() {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        progress.begin(&format!("ingest {name}"), records);
        summary += read_cloud(path, CHUNK, |chunk| {
            progress.check()?;
            let origins = sources.of_chunk(file, chunk);
            for run in tile_runs(chunk, &origins, file as u32, size_m, (keeps, &takes_part)) {
                if spill.push(run.tile, &run.records)? {
                    occupied.add(run.tile, path)?;
                }
            }
            progress.advance(chunk.len() as u64);
            Ok::<(), Error>(())
        })?;
    }

    let bins = spill.finish()?;
    progress.begin("sort tiles", bins.keys().len() as u64);
    let entries = bins
        .keys()
        .par_iter()
        .map(|key| {
            progress.check()?;
            let bytes = bins.read(key)?;
            let records = bytes.chunks_exact(keeps.record_bytes());
            let records: Vec<Record> = records.map(Record::decode).collect();
            let name = format!("{}_{}_{}", key[0], key[1], key[2]);
            let entry = write_tile(step, &name, tile_origin(key, size_m), &records, keeps)?;
            progress.advance(1);
            Ok(entry)
        })
        .collect::<Result<Vec<_>>>()?;

    write_json(&step.file(SOURCES), &sources.finish())?;
    write_json(&step.file("tiles.json"), &entries)?;
    Ok(summary)
}

/// Consecutive points of a file that lie in one tile.
struct TileRun {
    tile: [i64; 3],
    /// [`Record`]s as bytes.
    records: Vec<u8>,
}

/// The points of a chunk that take part, in their order; parts of the chunk are looked at in parallel.
fn tile_runs(
    chunk: &PointChunk,
    sources: &[PointSource],
    file: u32,
    size_m: f64,
    (keeps, takes_part): (Keeps, &(impl Fn(&Point3<f64>) -> bool + Sync)),
) -> Vec<TileRun> {
    let of_part = |part: usize| {
        let start = part * PART;
        let mut runs: Vec<TileRun> = Vec::new();
        for i in start..(start + PART).min(chunk.len()) {
            let p = &chunk.positions[i];
            if !takes_part(p) {
                continue;
            }
            let tile = cell_of(p, size_m);
            let record = Record {
                offset: (p - tile_origin(&tile, size_m)).cast::<f32>().into(),
                file,
                index: chunk.indices[i],
                source: sources[i],
                colour: chunk.colors.as_ref().map_or([0; 3], |all| all[i]),
                intensity: chunk.intensities.as_ref().map_or(0.0, |all| all[i]),
            };
            match runs.last_mut() {
                Some(run) if run.tile == tile => record.encode(keeps, &mut run.records),
                _ => {
                    let mut records = Vec::new();
                    record.encode(keeps, &mut records);
                    runs.push(TileRun { tile, records });
                }
            }
        }
        runs
    };

    let parts = (0..chunk.len().div_ceil(PART)).into_par_iter();
    parts.flat_map_iter(of_part).collect()
}

/// Records of a file at most; a line of text with three numbers has six bytes at least.
pub fn most_records(path: &Path) -> Result<u64> {
    match claimed_records(path)? {
        Some(records) => Ok(records),
        None => Ok(fs::metadata(path).map_err(Error::io("reading", path))?.len() / 6),
    }
}

/// The tiles that got a point, to stop before points that are no wall become a file each.
struct OccupiedTiles {
    tiles: Vec<[i64; 3]>,
    most: usize,
    size_m: f64,
}

impl OccupiedTiles {
    /// Tiles that any survey may have: those of 1 km of wall with its surroundings.
    const ANY: u64 = 5000;
    /// Points in a tile that more tiles must have, on average; a tile of a coarse cloud has thousands.
    const LEAST_POINTS: u64 = 50;

    fn new(records: u64, size_m: f64) -> Self {
        Self {
            tiles: Vec::new(),
            most: Self::ANY.max(records / Self::LEAST_POINTS) as usize,
            size_m,
        }
    }

    fn add(&mut self, tile: [i64; 3], path: &Path) -> Result<()> {
        self.tiles.push(tile);
        if self.tiles.len() <= self.most {
            return Ok(());
        }
        let extent_km = |axis: usize| {
            let places = || self.tiles.iter().map(|t| t[axis]);
            let cells = places().max().unwrap_or(0) - places().min().unwrap_or(0);
            cells as f64 * self.size_m / 1000.0
        };
        let longest = (0..3).map(extent_km).fold(0.0, f64::max);
        Err(Error::Input {
            path: path.to_path_buf(),
            message: format!(
                "the points lie up to {longest:.0} km apart, in more than {} tiles of {} m with less than {} points each: \
                 are coordinates in metres, and without stray points?",
                self.most,
                self.size_m,
                Self::LEAST_POINTS
            ),
        })
    }
}

/// Middle of the tile, so that offsets stay small.
fn tile_origin(key: &[i64; 3], size_m: f64) -> Point3<f64> {
    Point3::from(key.map(|k| (k as f64 + 0.5) * size_m))
}

/// A point on its way to its tile.
struct Record {
    offset: [f32; 3],
    file: u32,
    index: u64,
    source: PointSource,
    colour: [u16; 3],
    intensity: f32,
}

/// Length of a record without colour and intensity, and of these.
const PLACE_BYTES: usize = 30;
const VALUE_BYTES: usize = 10;

impl Record {
    fn encode(&self, keeps: Keeps, into: &mut Vec<u8>) {
        let mut bytes = [0; PLACE_BYTES + VALUE_BYTES];
        for (axis, value) in self.offset.iter().enumerate() {
            bytes[4 * axis..4 * axis + 4].copy_from_slice(&value.to_le_bytes());
        }
        bytes[12..16].copy_from_slice(&self.file.to_le_bytes());
        bytes[16..24].copy_from_slice(&self.index.to_le_bytes());
        bytes[24..26].copy_from_slice(&self.source.0.to_le_bytes());
        bytes[26..30].copy_from_slice(&self.source.1.to_le_bytes());
        for (channel, value) in self.colour.iter().enumerate() {
            bytes[30 + 2 * channel..32 + 2 * channel].copy_from_slice(&value.to_le_bytes());
        }
        bytes[36..].copy_from_slice(&self.intensity.to_le_bytes());
        into.extend_from_slice(&bytes[..keeps.record_bytes()]);
    }

    /// `bytes`: as long as a record is.
    fn decode(bytes: &[u8]) -> Self {
        let word = |at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
        let short = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let has_values = bytes.len() > PLACE_BYTES;
        let long = |at: usize| u64::from(u32::from_le_bytes(word(at)));
        Self {
            offset: [0, 4, 8].map(|at| f32::from_le_bytes(word(at))),
            file: u32::from_le_bytes(word(12)),
            index: long(16) | long(20) << 32,
            source: (short(24), f32::from_le_bytes(word(26))),
            colour: match has_values {
                true => [30, 32, 34].map(short),
                false => [0; 3],
            },
            intensity: match has_values {
                true => f32::from_le_bytes(word(36)),
                false => 0.0,
            },
        }
    }
}

fn write_tile(
    step: &StepDir,
    name: &str,
    origin: Point3<f64>,
    records: &[Record],
    keeps: Keeps,
) -> Result<TileEntry> {
    let cloud = Cloud::new(origin, records.iter().map(|r| r.offset).collect());
    let mut table = Table::new();
    for (axis, column) in ["x", "y", "z"].into_iter().enumerate() {
        let values: Vec<f32> = records.iter().map(|r| r.offset[axis]).collect();
        table.push(column, "m", "point, relative to the origin of its tile", values)?;
    }

    let files: Vec<u32> = records.iter().map(|r| r.file).collect();
    table.push("file", "", "number of the input file, from 0", files)?;
    let indices: Vec<u64> = records.iter().map(|r| r.index).collect();
    table.push("index", "", "number of the record in its file, from 0", indices)?;
    let sources: Vec<u32> = records.iter().map(|r| u32::from(r.source.0)).collect();
    table.push("source", "", "index of the source in sources.json", sources)?;
    let times: Vec<f32> = records.iter().map(|r| r.source.1).collect();
    table.push("time", "s", "time since the first point of its source", times)?;

    if keeps == Keeps::Values {
        for (channel, column) in ["red", "green", "blue"].into_iter().enumerate() {
            let values: Vec<u16> = records.iter().map(|r| r.colour[channel]).collect();
            table.push(column, "", "colour of the point, 0 to 65535", values)?;
        }
        let intensities: Vec<f32> = records.iter().map(|r| r.intensity).collect();
        table.push("intensity", "", "intensity, as the cloud has it", intensities)?;
    }

    write_parquet(&step.file(format!("{name}.parquet")), &table)?;
    let points = (0..cloud.len()).map(|i| cloud.world(i));
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
