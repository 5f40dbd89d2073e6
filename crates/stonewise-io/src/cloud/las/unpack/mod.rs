//! Compressed points, from the front of a file to its back.

mod context;
mod gps_time;
mod layer;
mod median;
mod point;
mod point_item;
mod record;

use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::chunks::{Chunk, Chunks};
use super::compression::Compression;
use super::las_error::las_error;
use crate::cloud::CloudError;
use record::{Decoder, decoder};

/// Bytes that are read from a file at a time.
const BUFFER_BYTES: usize = 1 << 20;

/// How the points of a file are compressed, and where they are.
pub struct Packing {
    pub compression: Compression,
    pub chunks: Chunks,
    /// Bytes of an unpacked point.
    pub record_bytes: u64,
}

/// Reader of compressed points.
pub struct LazReader {
    path: PathBuf,
    compression: Compression,
    record_bytes: usize,
    order: Reading,
}

/// How the chunks are read.
enum Reading {
    /// Several at a time, because their places are known.
    Parallel(ParallelChunks),
    /// One after the other, each from where the one before it ends.
    Serial(Box<SerialChunks>),
}

impl LazReader {
    /// Opens a file whose chunks were checked.
    pub fn open(path: &Path, packing: Packing) -> Result<Self, CloudError> {
        let file = File::open(path).map_err(|e| CloudError::read(path, e))?;
        let order = match packing.chunks {
            Chunks::Known(chunks) => Reading::Parallel(ParallelChunks {
                file,
                chunks: chunks.into_iter().enumerate(),
                open: None,
            }),
            Chunks::Large(chunks) => Reading::Serial(Box::new(SerialChunks::known(file, chunks))),
            Chunks::Unknown { start, points } => {
                let chunks = SerialChunks::unknown(file, start, points);
                Reading::Serial(Box::new(chunks.map_err(|e| CloudError::read(path, e))?))
            }
        };
        Ok(Self {
            path: path.to_owned(),
            compression: packing.compression,
            record_bytes: packing.record_bytes as usize,
            order,
        })
    }

    /// Unpacks the next points, as many as there is room for.
    pub fn fill(&mut self, records: &mut [u8]) -> Result<(), CloudError> {
        let Self {
            path,
            compression,
            record_bytes,
            order,
        } = self;
        let format = Format {
            compression,
            record_bytes: *record_bytes,
        };
        let unpacked = match order {
            Reading::Parallel(chunks) => chunks.fill(&format, records),
            Reading::Serial(chunks) => chunks.fill(&format, records),
        };
        unpacked.map_err(|(chunk, e)| chunk_error(path, chunk, e))
    }
}

/// How points are packed.
struct Format<'a> {
    compression: &'a Compression,
    record_bytes: usize,
}

/// An error comes with the number of its chunk, counted from 0.
type ChunkResult = Result<(), (usize, las::Error)>;

fn chunk_error(path: &Path, chunk: usize, error: las::Error) -> CloudError {
    match error {
        las::Error::Io(e) if e.kind() == io::ErrorKind::InvalidData => {
            CloudError::malformed(path, format!("chunk {}: {e}", chunk + 1))
        }
        other => las_error(path, other),
    }
}

/// The points of a chunk that are not unpacked yet.
struct Unpacking<R> {
    decoder: Decoder<R>,
    points: u64,
}

impl<R> Unpacking<R> {
    fn unpack(&mut self, format: &Format<'_>, records: &mut [u8]) -> io::Result<()> {
        self.points -= (records.len() / format.record_bytes) as u64;
        self.decoder.decompress_many(records)
    }
}

/// Cuts the bytes of at most this many points off the front of `records`.
fn split<'a>(records: &mut &'a mut [u8], points: u64, record_bytes: usize) -> &'a mut [u8] {
    let all = (records.len() / record_bytes) as u64;
    let bytes = points.min(all) as usize * record_bytes;
    let (front, back) = std::mem::take(records).split_at_mut(bytes);
    *records = back;
    front
}

/// Chunks whose bytes are read one after the other and unpacked side by side.
struct ParallelChunks {
    file: File,
    chunks: std::iter::Enumerate<std::vec::IntoIter<Chunk>>,
    open: Option<OpenChunk>,
}

/// A chunk of which some points are still packed.
struct OpenChunk {
    number: usize,
    /// Bytes of the chunk; empty once the first points are unpacked.
    packed: Vec<u8>,
    points: u64,
    unpacking: Option<Unpacking<Cursor<Vec<u8>>>>,
}

impl ParallelChunks {
    fn fill(&mut self, format: &Format<'_>, mut records: &mut [u8]) -> ChunkResult {
        let mut jobs = Vec::new();
        while records.len() >= format.record_bytes {
            let chunk = match self.open.take() {
                Some(chunk) => chunk,
                None => self.read_chunk()?,
            };
            let own = split(&mut records, chunk.points, format.record_bytes);
            jobs.push((chunk, own));
        }
        let unpacked: Vec<ChunkResult> = jobs
            .par_iter_mut()
            .map(|(chunk, records)| chunk.unpack(format, records))
            .collect();
        let last = jobs.pop().map(|(chunk, _)| chunk);
        self.open = last.filter(|chunk| chunk.points > 0);
        unpacked.into_iter().collect()
    }

    fn read_chunk(&mut self) -> Result<OpenChunk, (usize, las::Error)> {
        let chunk = self.chunks.find(|(_, chunk)| chunk.points > 0);
        let (number, Chunk { start, bytes, points }) = chunk.ok_or((0, ended()))?;
        let mut packed = Vec::new();
        self.file
            .seek(SeekFrom::Start(start))
            .and_then(|_| (&self.file).take(bytes).read_to_end(&mut packed))
            .map_err(|e| (number, e.into()))?;
        Ok(OpenChunk {
            number,
            packed,
            points,
            unpacking: None,
        })
    }
}

impl OpenChunk {
    fn unpack(&mut self, format: &Format<'_>, records: &mut [u8]) -> ChunkResult {
        let failed = |e| (self.number, e);
        let mut unpacking = match self.unpacking.take() {
            Some(unpacking) => unpacking,
            None => Unpacking {
                decoder: decoder(format.compression, Cursor::new(std::mem::take(&mut self.packed)))
                    .map_err(failed)?,
                points: self.points,
            },
        };
        unpacking.unpack(format, records).map_err(|e| failed(e.into()))?;
        self.points = unpacking.points;
        // The decoder of a whole chunk takes memory that the others need.
        self.unpacking = Some(unpacking).filter(|u| u.points > 0);
        Ok(())
    }
}

fn ended() -> las::Error {
    io::Error::from(io::ErrorKind::UnexpectedEof).into()
}

/// Chunks whose ends are unknown, or that are too large to be held in memory.
struct SerialChunks {
    /// The file, while no chunk is open.
    file: Option<BufReader<File>>,
    /// Empty if their places are unknown: each chunk then begins where the one before it ends.
    known: Vec<Chunk>,
    /// Points of each chunk whose place is unknown.
    points: u64,
    number: usize,
    unpacking: Option<Unpacking<BufReader<File>>>,
}

impl SerialChunks {
    fn known(file: File, chunks: Vec<Chunk>) -> Self {
        Self {
            file: Some(BufReader::with_capacity(BUFFER_BYTES, file)),
            known: chunks,
            points: 0,
            number: 0,
            unpacking: None,
        }
    }

    fn unknown(mut file: File, start: u64, points: u64) -> io::Result<Self> {
        file.seek(SeekFrom::Start(start))?;
        Ok(Self {
            points,
            ..Self::known(file, Vec::new())
        })
    }

    fn fill(&mut self, format: &Format<'_>, mut records: &mut [u8]) -> ChunkResult {
        while records.len() >= format.record_bytes {
            let mut unpacking = match self.unpacking.take() {
                Some(unpacking) => unpacking,
                None => self.next_chunk(format).map_err(|e| (self.number, e))?,
            };
            let own = split(&mut records, unpacking.points, format.record_bytes);
            unpacking
                .unpack(format, own)
                .map_err(|e| (self.number, e.into()))?;
            if unpacking.points > 0 {
                self.unpacking = Some(unpacking);
            } else {
                self.file = Some(unpacking.decoder.box_into_inner());
                self.number += 1;
            }
        }
        Ok(())
    }

    fn next_chunk(&mut self, format: &Format<'_>) -> Result<Unpacking<BufReader<File>>, las::Error> {
        let mut file = self.file.take().ok_or_else(ended)?;
        let mut points = self.points;
        if !self.known.is_empty() {
            while self.known.get(self.number).is_some_and(|chunk| chunk.points == 0) {
                self.number += 1;
            }
            let chunk = self.known.get(self.number).ok_or_else(ended)?;
            file.seek(SeekFrom::Start(chunk.start))?;
            points = chunk.points;
        }
        Ok(Unpacking {
            decoder: decoder(format.compression, file)?,
            points,
        })
    }
}
