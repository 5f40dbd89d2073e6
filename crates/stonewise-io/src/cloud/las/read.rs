//! Streaming LAS points.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use las::{LazParallelism, PointData, PointDataBuilder, Reader, ReaderOptions};
use nalgebra::Point3;

use super::Layout;
use super::layout::las_error;
use crate::cloud::chunk::Visit;
use crate::cloud::guard::guarded;
use crate::cloud::{CloudError, PointChunk, ReadSummary};

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
        let open = |parallelism| {
            guarded(path, || {
                let file = File::open(path).map_err(|e| CloudError::read(path, e))?;
                let options = ReaderOptions::default().with_laz_parallelism(parallelism);
                let file = BufReader::with_capacity(1 << 20, file);
                Reader::with_options(file, options).map_err(|e| las_error(path, e))
            })
        };
        // Files without chunks, as old writers make them, can only be read by one thread.
        let reader = open(LazParallelism::Yes).or_else(|_| open(LazParallelism::No))?;
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
        let wanted = (total - self.next_index).min(count.max(1) as u64);
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
        if !chunk.is_empty() {
            visit(&chunk)?;
        }
    }
    Ok(summary)
}
