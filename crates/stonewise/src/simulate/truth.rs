//! The truth of a simulated survey as files; never an input of the method.

use crate::simulate::SimulateError;
use serde::{Deserialize, Serialize};
use std::path::Path;
use stonewise_core::simulate::{Sensor, StoneTruth};
use stonewise_io::table::{Table, TableError, write_csv};

/// What was measured of each stone in one epoch, in the wall's order.
pub struct Seen {
    /// By scanners.
    pub scans: SeenByScans,
    /// Photos that show it.
    pub photos: Vec<u32>,
}

/// What terrestrial scanner and drone measured of each stone, in the wall's order.
#[derive(Serialize, Deserialize)]
pub struct SeenByScans {
    /// Points, those between the stones too.
    pub total: usize,
    /// Points of each stone.
    pub points: [Vec<u32>; 2],
    /// Cells of the face of each.
    pub cells: [Vec<u32>; 2],
}

/// A stone counts as shown in a photo from this many pixels on.
pub const SHOWN_PIXELS: u32 = 150;

/// Writes truth/stones.csv, one row a stone.
pub fn write_stone_table(path: &Path, truths: &[StoneTruth], seen: &[Seen]) -> Result<(), SimulateError> {
    Ok(write_csv(path, &stone_table(truths, seen)?)?)
}

fn stone_table(truths: &[StoneTruth], seen: &[Seen]) -> Result<Table, TableError> {
    let mut table = Table::new();
    table.push("stone_id", truths.iter().map(|t| t.id.0).collect::<Vec<_>>())?;
    let real = |get: &dyn Fn(&StoneTruth) -> f64| truths.iter().map(get).collect::<Vec<f64>>();
    let flag =
        |get: &dyn Fn(&StoneTruth) -> bool| truths.iter().map(|t| u32::from(get(t))).collect::<Vec<_>>();
    for (axis, name) in ["cx", "cy", "cz"].iter().enumerate() {
        table.push(name, real(&|t| t.centroid[axis]))?;
    }
    table.push("u", real(&|t| t.middle[0]))?;
    table.push("v", real(&|t| t.middle[1]))?;
    table.push("area_m2", real(&|t| t.area_m2))?;
    table.push("width", real(&|t| t.size_m[0]))?;
    table.push("height", real(&|t| t.size_m[1]))?;
    for (axis, name) in ["dx", "dy", "dz"].iter().enumerate() {
        table.push(name, real(&|t| t.displacement[axis]))?;
    }
    for (axis, name) in ["rx", "ry", "rz"].iter().enumerate() {
        table.push(name, real(&|t| t.rotation[axis]))?;
    }
    table.push("loose", flag(&|t| t.loose))?;
    for (axis, name) in ["bgx", "bgy", "bgz"].iter().enumerate() {
        table.push(name, real(&|t| t.shared[axis]))?;
    }
    table.push("edge", flag(&|t| t.edge))?;
    for (axis, name) in ["nx", "ny", "nz"].iter().enumerate() {
        table.push(name, real(&|t| t.normal[axis]))?;
    }
    let sensors = || Sensor::ALL.iter().map(|s| s.name()).enumerate();
    for (sensor, name) in sensors() {
        for (number, epoch) in (1..).zip(seen) {
            table.push(&format!("n_{name}_{number}"), epoch.scans.points[sensor].clone())?;
        }
    }
    for (number, epoch) in (1..).zip(seen) {
        table.push(&format!("n_img_{number}"), epoch.photos.clone())?;
    }
    for (sensor, name) in sensors() {
        let share = |i: usize, epoch: &Seen| truths[i].seen_share(epoch.scans.cells[sensor][i]);
        let least = |i: usize| seen.iter().map(|e| share(i, e)).fold(1.0, f64::min);
        table.push(
            &format!("vis_{name}"),
            (0..truths.len()).map(least).collect::<Vec<f64>>(),
        )?;
    }
    Ok(table)
}
