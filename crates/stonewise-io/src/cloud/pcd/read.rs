//! Streaming the points.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use nalgebra::Point3;

use super::header::{Encoding, Field, Header};
use super::lzf::{Lzf, MOST_GROWTH};
use crate::cloud::chunk::{Chunker, PointRecord, Visit};
use crate::cloud::lines::Lines;
use crate::cloud::scalar::Scalar;
use crate::cloud::scan::Scan;
use crate::cloud::{CloudError, ReadSummary};

/// Passes all points to `visit`.
///
/// The points lie in the frame of the file: its viewpoint names the place of the sensor, and does not move
/// them. Compressed files are unpacked once for each field that is needed, side by side, so that memory does
/// not grow with the file.
pub fn read<E: From<CloudError>>(
    path: &Path,
    chunk_points: usize,
    visit: Visit<'_, E>,
) -> Result<ReadSummary, E> {
    let mut lines = Lines::open(path)?;
    let header = Header::read(path, &mut lines)?;
    let columns = Columns::find(&header).ok_or_else(|| {
        CloudError::malformed(path, "the points of the PCD header have no numbers x, y and z")
    })?;
    let mut points = Points::begin(path, &header, &columns, lines)?;
    let (has_color, has_intensity) = (columns.color.is_some(), columns.intensity.is_some());
    let mut chunker = Chunker::new(chunk_points, has_color, has_intensity, visit);
    for index in 0..header.points {
        let record = points.next(&columns).map_err(|stop| match stop {
            Stop::Cloud(error) => error,
            Stop::Io(e) if e.kind() == io::ErrorKind::UnexpectedEof => {
                CloudError::truncated(path, format!("it holds {index} of {} points", header.points))
            }
            Stop::Io(e) if e.kind() == io::ErrorKind::InvalidData => {
                CloudError::malformed(path, "the compressed points are damaged: copy the file again")
            }
            Stop::Io(e) => CloudError::read(path, e),
        })?;
        chunker.push(record)?;
    }
    chunker.finish()
}

/// Number of points that the header claims.
pub fn point_count(path: &Path) -> Result<u64, CloudError> {
    Ok(Header::read(path, &mut Lines::open(path)?)?.points)
}

/// The scan of a file whose header names the place of the sensor.
pub fn scans(path: &Path) -> Result<Vec<Scan>, CloudError> {
    let header = Header::read(path, &mut Lines::open(path)?)?;
    let scan = header.viewpoint.map(|origin| Scan {
        name: "scan 1".to_owned(),
        records: header.points,
        origin: Some(origin),
        ..Scan::default()
    });
    Ok(scan.into_iter().collect())
}

/// The fields that are read.
struct Columns {
    position: [Field; 3],
    /// Red, green and blue in the bytes of one number.
    color: Option<Field>,
    intensity: Option<Field>,
}

impl Columns {
    fn find(header: &Header) -> Option<Self> {
        let find = |names: &[&str]| header.field(names).filter(|f| f.count > 0).cloned();
        Some(Self {
            position: [find(&["x"])?, find(&["y"])?, find(&["z"])?],
            color: find(&["rgb", "rgba"]).filter(|f| f.scalar.size() == 4),
            intensity: find(&["intensity", "i", "reflectance"]),
        })
    }

    fn all(&self) -> impl Iterator<Item = &Field> {
        self.position.iter().chain(&self.color).chain(&self.intensity)
    }

    /// A point of one value for each field of `all`.
    fn record(&self, mut value: impl FnMut(&Field) -> Result<Value, Stop>) -> Result<PointRecord, Stop> {
        let [x, y, z] = &self.position;
        let position = Point3::new(value(x)?.number, value(y)?.number, value(z)?.number);
        let color = self.color.as_ref().map(&mut value).transpose()?;
        let intensity = self.intensity.as_ref().map(&mut value).transpose()?;
        Ok(PointRecord {
            position: Some(position),
            color: color.map(|c| [16, 8, 0].map(|bit| u16::from((c.packed >> bit) as u8) * 257)),
            intensity: intensity.map(|i| i.number as f32),
        })
    }
}

/// A value as a number, and as the bits of a packed colour.
struct Value {
    number: f64,
    packed: u32,
}

impl Value {
    fn of_bytes(raw: [u8; 8], scalar: Scalar) -> Self {
        let [a, b, c, d, ..] = raw;
        Self {
            number: scalar.decode(raw),
            packed: u32::from_le_bytes([a, b, c, d]),
        }
    }

    /// Colours in fields of floating numbers are written as the number that their bits mean.
    fn of_word(word: &str, scalar: Scalar) -> Option<Self> {
        let number: f64 = word.parse().ok()?;
        let packed = match scalar {
            Scalar::F32 => word.parse::<f32>().ok()?.to_bits(),
            _ => number as u32,
        };
        Some(Self { number, packed })
    }
}

enum Stop {
    Cloud(CloudError),
    Io(io::Error),
}

impl From<CloudError> for Stop {
    fn from(error: CloudError) -> Self {
        Self::Cloud(error)
    }
}

impl From<io::Error> for Stop {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// The points, one at a time.
enum Points {
    Text {
        lines: Lines,
        values: u64,
    },
    Binary {
        bytes: BufReader<File>,
        row: Vec<u8>,
    },
    /// A stream for each field that is read.
    Compressed(Vec<Lzf<io::Take<BufReader<File>>>>),
}

impl Points {
    fn begin(path: &Path, header: &Header, columns: &Columns, mut lines: Lines) -> Result<Self, CloudError> {
        let left = lines.bytes_left()?;
        let check_room = |room: u64| {
            if room < header.points {
                let claimed = header.points;
                let reason = format!("it has room for {room} of the {claimed} points that its header claims");
                return Err(CloudError::truncated(path, reason));
            }
            Ok(())
        };

        match header.encoding {
            Encoding::Text => {
                // A digit and a space or the end of the line for each value; the last line may have no end.
                check_room((left + 1) / (2 * header.point_values))?;
                let values = header.point_values;
                Ok(Self::Text { lines, values })
            }
            Encoding::Binary => {
                check_room(left / header.point_bytes)?;
                let row = vec![0; header.point_bytes as usize];
                let bytes = lines.into_bytes();
                Ok(Self::Binary { bytes, row })
            }
            Encoding::Compressed if header.points == 0 => Ok(Self::Compressed(Vec::new())),
            Encoding::Compressed => {
                let read = |e| CloudError::read(path, e);
                let mut bytes = lines.into_bytes();
                let mut sizes = [0; 8];
                bytes.read_exact(&mut sizes).map_err(read)?;
                let [a, b, c, d, e, f, g, h] = sizes;
                let packed = u64::from(u32::from_le_bytes([a, b, c, d]));
                let unpacked = u64::from(u32::from_le_bytes([e, f, g, h]));
                if header.points.checked_mul(header.point_bytes) != Some(unpacked) {
                    let reason = format!(
                        "its compressed points take {unpacked} bytes, but {} points of {} bytes are claimed",
                        header.points, header.point_bytes
                    );
                    return Err(CloudError::malformed(path, reason));
                }
                if packed > left - 8 {
                    let reason = format!("it holds {} of {packed} bytes of compressed points", left - 8);
                    return Err(CloudError::truncated(path, reason));
                }
                check_room(packed * MOST_GROWTH / header.point_bytes)?;
                let start = bytes.stream_position().map_err(read)?;
                let stream = |field: &Field| {
                    let mut file = File::open(path)?;
                    file.seek(SeekFrom::Start(start))?;
                    let mut stream = Lzf::new(BufReader::with_capacity(1 << 16, file).take(packed));
                    stream.skip(field.offset * header.points)?;
                    Ok(stream)
                };
                let streams: io::Result<Vec<_>> = columns.all().map(stream).collect();
                streams.map(Self::Compressed).map_err(|e| match e.kind() {
                    io::ErrorKind::InvalidData => {
                        CloudError::malformed(path, "the compressed points are damaged: copy the file again")
                    }
                    _ => CloudError::read(path, e),
                })
            }
        }
    }

    fn next(&mut self, columns: &Columns) -> Result<PointRecord, Stop> {
        match self {
            Self::Text { lines, values } => {
                let Some(line) = lines.next_filled()? else {
                    return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
                };
                let words: Vec<&str> = line.split_ascii_whitespace().collect();
                if words.len() as u64 != *values {
                    let reason = format!("{} values, but a point has {values}", words.len());
                    return Err(lines.error(reason).into());
                }
                let value = |field: &Field| {
                    let word = words[field.first as usize];
                    Value::of_word(word, field.scalar)
                        .ok_or_else(|| format!("{word:?} is not a number (field {:?})", field.name))
                };
                // The line is borrowed until all of its words are numbers.
                let parsed: Result<Vec<Value>, String> = columns.all().map(value).collect();
                let mut parsed = parsed.map_err(|reason| lines.error(reason))?.into_iter();
                columns.record(|_| {
                    parsed
                        .next()
                        .ok_or_else(|| io::Error::from(io::ErrorKind::InvalidData).into())
                })
            }
            Self::Binary { bytes, row } => {
                bytes.read_exact(row)?;
                columns.record(|field| {
                    let mut raw = [0; 8];
                    let (offset, size) = (field.offset as usize, field.scalar.size());
                    raw[..size].copy_from_slice(&row[offset..offset + size]);
                    Ok(Value::of_bytes(raw, field.scalar))
                })
            }
            Self::Compressed(streams) => {
                let mut streams = streams.iter_mut();
                columns.record(|field| {
                    let stream = streams.next().ok_or(io::ErrorKind::InvalidData);
                    let stream = stream.map_err(io::Error::from)?;
                    let mut raw = [0; 8];
                    stream.fill(&mut raw[..field.scalar.size()])?;
                    // Further values of the field belong to nothing that is read.
                    stream.skip((field.count - 1) * field.scalar.size() as u64)?;
                    Ok(Value::of_bytes(raw, field.scalar))
                })
            }
        }
    }
}
