//! Streaming LAS points.

use std::path::{Path, PathBuf};

use las::{LazParallelism, PointData, PointDataBuilder, Reader, ReaderOptions};
use nalgebra::Point3;

use super::Layout;
use super::las_error::las_error;
use super::stream::LasStream;
use crate::cloud::chunk::Visit;
use crate::cloud::guard::guarded;
use crate::cloud::{CloudError, PointChunk, ReadSummary};

/// Bytes of records that are unpacked at a time, at most; a record has 65,535 at most.
const MAX_STEP_BYTES: u64 = 1 << 27;

/// Points of a LAS file, some at a time, as raw records.
pub struct LasSource {
    path: PathBuf,
    pub layout: Layout,
    reader: Reader,
    data: PointData,
    next_index: u64,
}

impl LasSource {
    pub fn open(path: &Path) -> Result<Self, CloudError> {
        let layout = Layout::open(path)?;
        let parallelism = if layout.one_thread {
            LazParallelism::No
        } else {
            LazParallelism::Yes
        };
        let reader = guarded(path, || {
            let stream = LasStream::open(path, layout.corrections).map_err(|e| CloudError::read(path, e))?;
            let options = ReaderOptions::default().with_laz_parallelism(parallelism);
            Reader::with_options(stream, options).map_err(|e| las_error(path, e))
        })?;
        Ok(Self {
            path: path.to_owned(),
            data: PointDataBuilder::new().for_header(reader.header()).build(),
            layout,
            reader,
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
            path, reader, data, ..
        } = self;
        guarded(path, || {
            reader.fill_points(wanted, data).map_err(|e| las_error(path, e))
        })?;
        let first = self.next_index;
        self.next_index += wanted;
        Ok(Some((first, &self.data)))
    }
}

/// Puts the points of raw records into a chunk; says how many were left out.
pub fn fill_chunk(chunk: &mut PointChunk, first_index: u64, data: &PointData) -> u64 {
    chunk.indices.clear();
    chunk.positions.clear();
    let positions = data.x().zip(data.y()).zip(data.z());
    for (index, ((x, y), z)) in (first_index..).zip(positions) {
        if x.is_finite() && y.is_finite() && z.is_finite() {
            chunk.indices.push(index);
            chunk.positions.push(Point3::new(x, y, z));
        }
    }
    let kept = |index: &u64| (index - first_index) as usize;
    let intensities: Vec<f32> = data.intensity().map(f32::from).collect();
    let rows = chunk.indices.iter().map(kept);
    chunk.intensities = Some(rows.map(|row| intensities[row]).collect());
    let colors = data
        .rgb()
        .map(|rgb| rgb.map(|(r, g, b)| [r, g, b]).collect::<Vec<_>>());
    chunk.colors = colors.map(|all| chunk.indices.iter().map(|i| all[kept(i)]).collect());
    let sources: Vec<u16> = data.point_source_id().collect();
    chunk.sources = Some(chunk.indices.iter().map(|i| sources[kept(i)]).collect());
    let times = data.gps_time().map(|times| times.collect::<Vec<f64>>());
    chunk.times_s = times.map(|all| chunk.indices.iter().map(|i| all[kept(i)]).collect());
    data.len() as u64 - chunk.len() as u64
}

/// Passes all points to `visit`.
pub fn read<E: From<CloudError>>(
    path: &Path,
    chunk_points: usize,
    visit: Visit<'_, E>,
) -> Result<ReadSummary, E> {
    let mut source = LasSource::open(path)?;
    let mut chunk = PointChunk::default();
    let mut summary = ReadSummary::default();
    while let Some((first, data)) = source.next(chunk_points)? {
        summary.records += data.len() as u64;
        summary.skipped += fill_chunk(&mut chunk, first, data);
        visit(&chunk)?;
    }
    Ok(summary)
}
