//! The clouds of an epoch, as far as a look needs them.

use super::Depth;
use super::unreadable::Unreadable;
use crate::Epoch;
use nalgebra::Point3;
use std::collections::HashMap;
use std::ops::ControlFlow;
use std::path::Path;
use stonewise_base::error::Result;
use stonewise_base::messages::findings::CLOUDS;
use stonewise_core::geometry::{Bounds, cell_of};
use stonewise_io::cloud::{Remark, cloud_info, read_first};
use stonewise_io::crs::Units;

/// Points of an epoch that are looked at, quickly and fully.
const POINTS: [u64; 2] = [500_000, 6_000_000];
/// Points read at a time.
const CHUNK: usize = 250_000;
/// Edge of the cells in which the density of points is counted, metres.
const CELL_M: f64 = 0.05;

/// What is known of an epoch's clouds.
#[derive(Default)]
pub(super) struct Sample {
    /// Box around all points.
    pub bounds: Option<Bounds>,
    /// Number of records.
    pub records: u64,
    /// Records that were looked at.
    pub passed: u64,
    /// Withheld points and noise among these.
    pub unused: u64,
    /// The first points of each cloud.
    pub points: Vec<Point3<f64>>,
    /// Distance between neighbours on the surface, metres.
    pub spacing_m: Option<f64>,
    /// Coordinate systems, as the clouds name them; `None` where one names none.
    pub crs: Vec<Option<String>>,
    /// Units of the coordinates in each file.
    pub units: Vec<Units>,
    /// What is odd about a file, with its name.
    pub remarks: Vec<(String, Remark)>,
}

impl Sample {
    /// Whether every record was looked at.
    pub fn is_whole(&self) -> bool {
        self.passed >= self.records
    }

    /// Adds a cloud and the first `left` of its points.
    fn add(&mut self, path: &Path, mut left: usize) -> Result<()> {
        let info = cloud_info(path)?;
        self.records += info.records;
        self.crs.push(info.crs);
        self.units.push(info.units);
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        self.remarks
            .extend(info.remarks.into_iter().map(|remark| (name.to_string(), remark)));
        if let Some(bounds) = info.bounds {
            self.bounds = Some(self.bounds.map_or(bounds, |b| b.union(&bounds)));
        }
        let before = self.passed;
        let whole = read_first(path, CHUNK, |chunk| {
            let last = chunk.indices.last().map_or(0, |index| index + 1);
            self.passed = self.passed.max(before + last);
            self.unused += chunk.unused;
            let taken = left.min(chunk.positions.len());
            self.points.extend_from_slice(&chunk.positions[..taken]);
            left -= taken;
            match left {
                0 => ControlFlow::Break(()),
                _ => ControlFlow::Continue(()),
            }
        })?;
        if let Some(summary) = whole {
            self.passed = before + summary.records;
        }
        Ok(())
    }
}

/// Reads what is needed of an epoch's clouds; `None` where one of them cannot be read.
///
/// # Errors
/// At quick depth, a cloud cannot be read.
pub(super) fn sample(epoch: &Epoch, depth: Depth, unreadable: &mut Unreadable) -> Result<Option<Sample>> {
    let mut sample = Sample::default();
    let points = POINTS[usize::from(depth == Depth::Full)];
    let share = points / epoch.clouds.len().max(1) as u64;
    let mut is_whole = true;
    for path in &epoch.clouds {
        let read = sample.add(path, share as usize);
        is_whole &= unreadable.keep(epoch, &CLOUDS, read)?.is_some();
    }
    sample.spacing_m = spacing(&sample.points);
    Ok(is_whole.then_some(sample))
}

/// Median distance between neighbours on a surface: the root of the area that each point of a cell has for
/// itself.
fn spacing(points: &[Point3<f64>]) -> Option<f64> {
    let mut cell_m = CELL_M;
    // Sparser clouds are counted in larger cells.
    for _ in 0..8 {
        let mut counts: HashMap<[i64; 3], u32> = HashMap::new();
        for p in points {
            *counts.entry(cell_of(p, cell_m)).or_default() += 1;
        }
        // Sorted, so that the map's order does not matter.
        let mut counts: Vec<u32> = counts.into_values().collect();
        counts.sort_unstable();
        // The cell of the usual point, not the usual cell: sparse surroundings take much room.
        let half = points.len() as u64 / 2;
        let mut passed = 0;
        let median = counts.iter().copied().find(|n| {
            passed += u64::from(*n);
            passed >= half
        })?;
        if median >= 6 {
            return Some(cell_m / f64::from(median).sqrt());
        }
        cell_m *= 2.0;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spacing_of_a_grid_is_found() {
        for step in [0.004, 0.011, 0.03] {
            let side = (2.0 / step) as i32;
            let grid = (0..side).flat_map(|i| (0..side).map(move |j| (f64::from(i), f64::from(j))));
            let points: Vec<_> = grid
                .map(|(i, j)| Point3::new(1.0 + i * step, 0.01, j * step))
                .collect();
            let found = spacing(&points).unwrap();
            assert!((found / step - 1.0).abs() < 0.15, "{step}: {found}");
        }
        assert_eq!(spacing(&[]), None);
    }
}
