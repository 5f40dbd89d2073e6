//! The chunks of a compressed file: their table, and the layers inside them.
//!
//! Format: LAZ specification 1.4 R1 (chunk table, compressors 1 to 3). A chunk of layers begins with its
//! first point, the number of its points, and the size of every layer; the decoder takes memory for a layer
//! before it looks for its bytes.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};

use laz::laszip::{ChunkTable, ChunkTableEntry};
use laz::{LazItemType, LazVlr};

use super::compression::{Compression, Order};
use super::envelope::Envelope;
use super::las_error::las_error;
use crate::cloud::CloudError;

/// Chunks larger than this when unpacked are read by one thread, which needs no memory for them; LAZ chunks
/// are usually 50,000 points.
const LARGE_CHUNK_BYTES: u64 = 1 << 26;
/// Points for each byte of a file, at most: a point like the one before it takes a small part of a bit.
const MAX_POINTS_PER_BYTE: u64 = 1 << 20;
/// Bytes of the place of the chunk table, in front of the first chunk.
const TABLE_PLACE_BYTES: u64 = 8;

/// What the reader needs of the chunks.
#[derive(Debug)]
pub enum Chunks {
    /// They can be unpacked side by side.
    Known(Vec<Chunk>),
    /// One of them is too large to be held in memory.
    Large(Vec<Chunk>),
    /// The file does not say where they end.
    Unknown {
        /// Where the first one begins.
        start: u64,
        /// Points of each.
        points: u64,
    },
}

/// Points that are packed together.
#[derive(Clone, Copy, Debug)]
pub struct Chunk {
    /// Where in the file it begins.
    pub start: u64,
    pub bytes: u64,
    pub points: u64,
}

impl Chunks {
    /// Checks that the chunks and their layers lie inside the file and hold the points that the header
    /// claims; also gives the number of points that they hold at least.
    pub fn check(file: &Envelope, compression: &Compression) -> Result<(Self, u64), CloudError> {
        let (points, path) = (file.points(), &file.path);
        if points == 0 {
            // The chunks must not be read, whatever their table says.
            return Ok((Self::Known(Vec::new()), 0));
        }
        let bytes = file.length - file.start();
        if points / MAX_POINTS_PER_BYTE > bytes {
            let reason = format!("it holds {bytes} bytes of points, and its header claims {points} points");
            return Err(CloudError::truncated(path, reason));
        }
        if compression.order == Order::Stream {
            let start = file.start();
            return Ok((Self::Unknown { start, points }, points));
        }
        let vlr = &compression.vlr;
        let table = table_place(file)?.map(|place| read_table(file, vlr, place));
        // A table without chunks is that of a writer that has not come to it.
        let Some(chunks) = table.transpose()?.filter(|chunks| !chunks.is_empty()) else {
            let unknown = || Self::Unknown {
                start: first_chunk(file),
                points: u64::from(vlr.chunk_size()),
            };
            return match compression.order {
                Order::Layers => walk_layers(file, vlr).map(|chunks| (Self::of(file, chunks), points)),
                _ if vlr.uses_variable_size_chunks() => Err(CloudError::malformed(
                    path,
                    "the table of its chunks is missing: write the file again",
                )),
                _ => Ok((unknown(), points)),
            };
        };
        check_table(file, vlr, &chunks)?;
        let held = match compression.order {
            Order::Layers => check_layers(file, vlr, &chunks)?,
            // Of the last one, the table says nothing.
            _ => {
                1 + chunks[..chunks.len() - 1]
                    .iter()
                    .map(|chunk| chunk.points)
                    .sum::<u64>()
            }
        };
        Ok((Self::of(file, chunks), held))
    }

    fn of(file: &Envelope, chunks: Vec<Chunk>) -> Self {
        let largest = chunks.iter().map(|chunk| chunk.points).max().unwrap_or(0);
        if largest.saturating_mul(file.record_bytes()) > LARGE_CHUNK_BYTES {
            Self::Large(chunks)
        } else {
            Self::Known(chunks)
        }
    }
}

fn first_chunk(file: &Envelope) -> u64 {
    file.start() + TABLE_PLACE_BYTES
}

/// Where the table of chunks is; `None` where there is none.
fn table_place(file: &Envelope) -> Result<Option<u64>, CloudError> {
    let mut source = open(file)?;
    let mut place = number_at(file, &mut source, file.start())?;
    if place <= file.start().cast_signed() {
        // A writer that could not go back has put the place at the very end.
        place = number_at(file, &mut source, file.length - TABLE_PLACE_BYTES)?;
    } else if place.cast_unsigned() > file.length {
        let reason = "the table of its chunks, which comes last, is missing";
        return Err(CloudError::truncated(&file.path, reason));
    }
    let place = u64::try_from(place).unwrap_or(0);
    Ok((first_chunk(file) < place && place <= file.length - TABLE_PLACE_BYTES).then_some(place))
}

fn read_table(file: &Envelope, vlr: &LazVlr, place: u64) -> Result<Vec<Chunk>, CloudError> {
    let mut source = open(file)?;
    let head = number_at(file, &mut source, place)?.cast_unsigned();
    let room = (place - file.start()) / file.record_bytes().max(1);
    if head >> 32 > room.min(file.points()) {
        // The first point of a chunk is not compressed.
        let reason = format!(
            "its table names {} chunks, more than there is room for",
            head >> 32
        );
        return Err(CloudError::malformed(&file.path, reason));
    }
    seek(file, &mut source, file.start())?;
    let table = ChunkTable::read_from(&mut source, vlr);
    let table = table.map_err(|e| las_error(&file.path, las::Error::from(e)))?;
    let mut next = first_chunk(file);
    let chunk = |entry: &ChunkTableEntry| {
        let start = next;
        next = next.saturating_add(entry.byte_count);
        Chunk {
            start,
            bytes: entry.byte_count,
            points: entry.point_count,
        }
    };
    Ok(table.as_ref().iter().map(chunk).collect())
}

fn check_table(file: &Envelope, vlr: &LazVlr, chunks: &[Chunk]) -> Result<(), CloudError> {
    let held = chunks.iter().fold(0u64, |n, c| n.saturating_add(c.points));
    let bytes = chunks.iter().fold(0u64, |n, c| n.saturating_add(c.bytes));
    let points = file.points();
    if held < points || (vlr.uses_variable_size_chunks() && held != points) {
        let reason = format!("its chunks hold {held} of {points} points");
        return Err(CloudError::truncated(&file.path, reason));
    }
    if bytes > file.length - file.start() {
        return Err(CloudError::truncated(
            &file.path,
            "its chunks are larger than the file",
        ));
    }
    Ok(())
}

/// Checks that no chunk of the table has layers that are larger than it; returns the sum of their points.
fn check_layers(file: &Envelope, vlr: &LazVlr, chunks: &[Chunk]) -> Result<u64, CloudError> {
    let mut source = open(file)?;
    let mut held = 0;
    for (number, chunk) in (1..).zip(chunks).filter(|(_, chunk)| chunk.bytes > 0) {
        let layers = layered_chunk(file, vlr, &mut source, chunk.start)?;
        if layers.bytes > chunk.bytes {
            let reason = format!(
                "the layers of chunk {number} take {} bytes, and the chunk has {}",
                layers.bytes, chunk.bytes
            );
            return Err(CloudError::malformed(&file.path, reason));
        }
        held += layers.points;
    }
    Ok(held)
}

/// Walks from chunk to chunk by the sizes of their layers, for files without a table.
fn walk_layers(file: &Envelope, vlr: &LazVlr) -> Result<Vec<Chunk>, CloudError> {
    let mut source = open(file)?;
    let mut place = first_chunk(file);
    let mut held = 0;
    let mut chunks = Vec::new();
    while held < file.points() {
        let layers = layered_chunk(file, vlr, &mut source, place)?;
        place += layers.bytes;
        if place > file.length || layers.points == 0 {
            let reason = format!("its whole chunks hold {held} of {} points", file.points());
            return Err(CloudError::truncated(&file.path, reason));
        }
        held += layers.points;
        chunks.push(layers);
    }
    Ok(chunks)
}

/// A chunk of layers as its head describes it; its bytes include the head.
fn layered_chunk(
    file: &Envelope,
    vlr: &LazVlr,
    source: &mut BufReader<File>,
    start: u64,
) -> Result<Chunk, CloudError> {
    let mut word = [0; 4];
    let mut next = |source: &mut BufReader<File>| {
        let read = source.read_exact(&mut word);
        read.map_err(|e| CloudError::read(&file.path, e))?;
        Ok(u64::from(u32::from_le_bytes(word)))
    };
    seek(file, source, start + file.record_bytes())?;
    let points = next(source)?;
    let mut bytes = file.record_bytes() + 4;
    for _ in 0..layer_count(vlr) {
        bytes += 4 + next(source)?;
    }
    Ok(Chunk { start, bytes, points })
}

fn layer_count(vlr: &LazVlr) -> usize {
    let layers = |kind: LazItemType| match kind {
        LazItemType::Point14 => 9,
        LazItemType::RGB14 | LazItemType::WavePacket14 => 1,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(bytes) => usize::from(bytes),
        _ => 0,
    };
    vlr.items().iter().map(|item| layers(item.item_type())).sum()
}

fn open(file: &Envelope) -> Result<BufReader<File>, CloudError> {
    let opened = File::open(&file.path).map_err(|e| CloudError::read(&file.path, e))?;
    Ok(BufReader::new(opened))
}

fn seek(file: &Envelope, source: &mut BufReader<File>, place: u64) -> Result<(), CloudError> {
    let moved = source.seek(SeekFrom::Start(place));
    moved.map(|_| ()).map_err(|e| CloudError::read(&file.path, e))
}

fn number_at(file: &Envelope, source: &mut BufReader<File>, place: u64) -> Result<i64, CloudError> {
    seek(file, source, place)?;
    let mut bytes = [0; 8];
    let read = source.read_exact(&mut bytes);
    read.map_err(|e| CloudError::read(&file.path, e))?;
    Ok(i64::from_le_bytes(bytes))
}
