//! Some points of a cloud, as they pass by.

use nalgebra::Point3;
use std::ops::AddAssign;

/// A run of points of one file, in the order of the file.
///
/// Records without a finite position, withheld ones and noise are left out, so `indices` may have gaps; the other columns
/// are parallel to it. A chunk never crosses from one scan of a file into the next. Where a long part of a file holds
/// no points, chunks without points pass by.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointChunk {
    /// Index of each point's record in the file, from 0, ascending; counts across the scans of a file.
    pub indices: Vec<u64>,
    /// Positions in the world frame, metres, whatever the unit of the file; the pose of a scan is applied.
    pub positions: Vec<Point3<f64>>,
    /// Red, green, blue, 16 bits each (8-bit colours are times 257), where the file has colours.
    pub colors: Option<Vec<[u16; 3]>>,
    /// Intensities as the file has them (LAS: 0 to 65535; PTX: 0 to 1; PTS: often -2048 to 2047; E57: scaled to 0
    /// to 1), where it has any.
    pub intensities: Option<Vec<f32>>,
    /// Index of the scan in [`CloudInfo::scans`](super::CloudInfo::scans), where the file keeps scans apart.
    pub scan: Option<usize>,
    /// Number of the station or flight line of each point (LAS: point source ID), where the file has them.
    pub sources: Option<Vec<u16>>,
    /// Records among these that are left out because they are withheld or noise (LAS: the flag, classes 7 and 18).
    pub unused: u64,
    /// Time of each point as the file has it, seconds (LAS: GPS time), where it has times.
    pub times_s: Option<Vec<f64>>,
}

impl PointChunk {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
}

/// What a pass over a file found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadSummary {
    /// Records in the file.
    pub records: u64,
    /// Records left out because they have no finite position (marked invalid, without echo, NaN, infinite).
    pub skipped: u64,
    /// Records left out because they are withheld or noise, see [`PointChunk::unused`].
    pub unused: u64,
}

impl AddAssign for ReadSummary {
    fn add_assign(&mut self, other: Self) {
        self.records += other.records;
        self.skipped += other.skipped;
        self.unused += other.unused;
    }
}

/// Receives chunks.
pub(super) type Visit<'a, E> = &'a mut dyn FnMut(&PointChunk) -> Result<(), E>;

/// Collects points and hands them on when a chunk is full.
pub(super) struct Chunker<'a, E> {
    chunk: PointChunk,
    capacity: usize,
    /// Things of the file other than points that were read since the last visit.
    passed: usize,
    visit: Visit<'a, E>,
    summary: ReadSummary,
}

/// One record, as a reader without columns sees it.
pub(super) struct PointRecord {
    pub position: Option<Point3<f64>>,
    pub color: Option<[u16; 3]>,
    pub intensity: Option<f32>,
}

impl<'a, E> Chunker<'a, E> {
    pub fn new(capacity: usize, has_color: bool, has_intensity: bool, visit: Visit<'a, E>) -> Self {
        let chunk = PointChunk {
            colors: has_color.then(Vec::new),
            intensities: has_intensity.then(Vec::new),
            ..PointChunk::default()
        };
        Self {
            chunk,
            capacity: capacity.max(1),
            passed: 0,
            visit,
            summary: ReadSummary::default(),
        }
    }

    /// Starts the next scan.
    pub fn begin_scan(&mut self, scan: usize, has_color: bool, has_intensity: bool) -> Result<(), E> {
        self.flush()?;
        self.chunk.scan = Some(scan);
        self.chunk.colors = has_color.then(Vec::new);
        self.chunk.intensities = has_intensity.then(Vec::new);
        Ok(())
    }

    pub fn push(&mut self, record: PointRecord) -> Result<(), E> {
        let index = self.summary.records;
        self.summary.records += 1;
        let Some(position) = record.position.filter(|p| p.iter().all(|c| c.is_finite())) else {
            self.summary.skipped += 1;
            return self.pass();
        };
        self.chunk.indices.push(index);
        self.chunk.positions.push(position);
        if let Some(colors) = &mut self.chunk.colors {
            colors.push(record.color.unwrap_or_default());
        }
        if let Some(intensities) = &mut self.chunk.intensities {
            intensities.push(record.intensity.unwrap_or_default());
        }
        if self.chunk.len() >= self.capacity {
            self.flush()?;
        }
        Ok(())
    }

    /// Counts something that was read and is no point; many of them make a visit, so that the caller can
    /// stop.
    pub fn pass(&mut self) -> Result<(), E> {
        self.passed += 1;
        if self.passed < self.capacity {
            return Ok(());
        }
        self.passed = 0;
        (self.visit)(&PointChunk::default())
    }

    pub fn finish(mut self) -> Result<ReadSummary, E> {
        self.flush()?;
        Ok(self.summary)
    }

    fn flush(&mut self) -> Result<(), E> {
        if !self.chunk.is_empty() {
            (self.visit)(&self.chunk)?;
        }
        self.passed = 0;
        self.chunk.indices.clear();
        self.chunk.positions.clear();
        if let Some(colors) = &mut self.chunk.colors {
            colors.clear();
        }
        if let Some(intensities) = &mut self.chunk.intensities {
            intensities.clear();
        }
        Ok(())
    }
}
