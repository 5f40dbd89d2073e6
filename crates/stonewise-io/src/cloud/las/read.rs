//! Streaming LAS points.

use std::path::{Path, PathBuf};

use las::{PointData, PointDataBuilder, Reader};
use nalgebra::Point3;

use super::Layout;
use super::las_error::las_error;
use super::stream::LasStream;
use super::unpack::LazReader;
use crate::cloud::chunk::Visit;
use crate::cloud::guard::guarded;
use crate::cloud::{CloudError, PointChunk, ReadSummary};
use crate::crs::Units;

/// Bytes of records that are unpacked at a time, at most; a record has 65,535 at most.
const MAX_STEP_BYTES: u64 = 1 << 27;

/// Classes of points that no surface sent back: low points and high noise (LAS 1.4 R15, table 17).
const NOISE: [u8; 2] = [7, 18];

/// Points of a LAS file, some at a time, as raw records.
pub struct LasSource {
    path: PathBuf,
    pub layout: Layout,
    records: Records,
    data: PointData,
    next_index: u64,
}

/// Where the records come from.
enum Records {
    Plain(Reader),
    Packed(LazReader),
}

impl LasSource {
    pub fn open(path: &Path) -> Result<Self, CloudError> {
        let mut layout = Layout::open(path)?;
        let records = match layout.packing.take() {
            Some(packing) => Records::Packed(LazReader::open(path, packing)?),
            None => Records::Plain(guarded(path, || {
                let header = layout.sound_header.clone();
                let stream = LasStream::open(path, header).map_err(|e| CloudError::read(path, e))?;
                Reader::new(stream).map_err(|e| las_error(path, e))
            })?),
        };
        Ok(Self {
            path: path.to_owned(),
            data: PointDataBuilder::new().for_header(&layout.header).build(),
            layout,
            records,
            next_index: 0,
        })
    }

    /// The next records, at most `count`, with the index of the first; `None` at the end.
    pub fn next(&mut self, count: usize) -> Result<Option<(u64, &PointData)>, CloudError> {
        let total = self.layout.header.number_of_points();
        let record = u64::from(self.layout.header.point_format().len()).max(1);
        let most = (count.max(1) as u64).min(MAX_STEP_BYTES / record);
        let wanted = (total - self.next_index).min(most);
        if wanted == 0 {
            return Ok(None);
        }
        let Self {
            path, records, data, ..
        } = self;
        guarded(path, || match records {
            Records::Plain(reader) => {
                let read = reader.fill_points(wanted, data);
                read.map(|_| ()).map_err(|e| las_error(path, e))
            }
            Records::Packed(reader) => reader.fill(data.resize_for(wanted as usize)),
        })?;
        let first = self.next_index;
        self.next_index += wanted;
        Ok(Some((first, &self.data)))
    }
}

/// Puts the points of raw records into a chunk, in metres; says how many there were, and how many were left out.
pub fn fill_chunk(chunk: &mut PointChunk, first_index: u64, data: &PointData, units: Units) -> ReadSummary {
    chunk.indices.clear();
    chunk.positions.clear();
    let mut summary = ReadSummary {
        records: data.len() as u64,
        ..ReadSummary::default()
    };
    let positions = data.x().zip(data.y()).zip(data.z());
    let usable = data.classification().zip(withheld(data));
    for ((index, ((x, y), z)), (class, withheld)) in (first_index..).zip(positions).zip(usable) {
        if !(x.is_finite() && y.is_finite() && z.is_finite()) {
            summary.skipped += 1;
        } else if withheld || NOISE.contains(&class) {
            summary.unused += 1;
        } else {
            chunk.indices.push(index);
            chunk.positions.push(units.to_metres(Point3::new(x, y, z)));
        }
    }
    chunk.unused = summary.unused;
    let indices = &chunk.indices;
    chunk.intensities = Some(kept(indices, first_index, data.intensity().map(f32::from)));
    let colors = data.rgb().map(|rgb| rgb.map(|(r, g, b)| [r, g, b]));
    chunk.colors = colors.map(|all| kept(indices, first_index, all));
    chunk.sources = Some(kept(indices, first_index, data.point_source_id()));
    chunk.times_s = data.gps_time().map(|all| kept(indices, first_index, all));
    summary
}

/// Whether each record is flagged as withheld: the last bit of the class, or a bit of its own in the extended formats
/// (LAS 1.4 R15, tables 8 and 16).
fn withheld(data: &PointData) -> impl Iterator<Item = bool> + '_ {
    let place = 15;
    let bit = if data.format().is_extended { 1 << 2 } else { 1 << 7 };
    let records = data.raw_bytes().chunks_exact(data.record_len());
    records.map(move |record| record[place] & bit != 0)
}

/// Values of the records that are kept, of one value for each record from `first_index` on.
fn kept<T: Copy>(indices: &[u64], first_index: u64, values: impl Iterator<Item = T>) -> Vec<T> {
    let all: Vec<T> = values.collect();
    if indices.len() == all.len() {
        return all;
    }
    indices.iter().map(|i| all[(i - first_index) as usize]).collect()
}

/// Passes all points to `visit`.
pub fn read<E: From<CloudError>>(
    path: &Path,
    chunk_points: usize,
    visit: Visit<'_, E>,
) -> Result<ReadSummary, E> {
    let mut source = LasSource::open(path)?;
    let units = source.layout.system.units;
    let mut chunk = PointChunk::default();
    let mut summary = ReadSummary::default();
    while let Some((first, data)) = source.next(chunk_points)? {
        summary += fill_chunk(&mut chunk, first, data, units);
        visit(&chunk)?;
    }
    Ok(summary)
}
