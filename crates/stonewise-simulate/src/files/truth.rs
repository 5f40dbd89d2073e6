//! The truth of a simulated survey as files; never an input of the method.

use crate::files::SimulateError;
use crate::world::{Sensor, StoneTruth};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::path::Path;
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

/// What the table as a whole holds.
const DESCRIPTION: &str =
    "The true stones of a simulated wall, one row per stone. Motions are later epoch minus first.";

/// Writes truth/stones.csv, one row a stone, and the metadata of its columns.
pub fn write_stone_table(path: &Path, truths: &[StoneTruth], seen: &[Seen]) -> Result<(), SimulateError> {
    let table = stone_table(truths, seen)?;
    Ok(write_csv(path, &table, DESCRIPTION, Some("stone_id"))?)
}

fn stone_table(truths: &[StoneTruth], seen: &[Seen]) -> Result<Table, TableError> {
    let mut table = Table::new();
    let real = |get: &dyn Fn(&StoneTruth) -> f64| truths.iter().map(get).collect::<Vec<f64>>();
    let flag =
        |get: &dyn Fn(&StoneTruth) -> bool| truths.iter().map(|t| u32::from(get(t))).collect::<Vec<_>>();
    let numbers: Vec<u32> = truths.iter().map(|t| t.id.0).collect();
    table.push("stone_id", "", "number of the stone in the wall", numbers)?;
    let vector = |table: &mut Table, stem: &str, unit: &str, meaning: &str, of: VectorOf| {
        AXES.iter().enumerate().try_for_each(|(axis, name)| {
            let meaning = format!("{meaning}, world {name}");
            table.push(&format!("{stem}{name}"), unit, &meaning, real(&|t| of(t)[axis]))
        })
    };
    let meaning = "centroid of the face in the first epoch, seen at right angles to the wall";
    vector(&mut table, "c", "m", meaning, |t| t.centroid.coords)?;
    table.push(
        "u",
        "m",
        "position of the middle of the stone along the face",
        real(&|t| t.middle[0]),
    )?;
    table.push(
        "v",
        "m",
        "position of the middle of the stone up the face",
        real(&|t| t.middle[1]),
    )?;
    let meaning = "area of the face, seen at right angles to the wall";
    table.push("area_m2", "m2", meaning, real(&|t| t.area_m2))?;
    table.push("width", "m", "width on the face", real(&|t| t.size_m[0]))?;
    table.push("height", "m", "height on the face", real(&|t| t.size_m[1]))?;
    let meaning = "displacement of the centroid, later epoch minus first";
    vector(&mut table, "d", "m", meaning, |t| t.displacement)?;
    vector(&mut table, "r", "rad", "rotation vector", |t| t.rotation)?;
    let meaning = "1 where the stone moves on its own, else 0";
    table.push("loose", "", meaning, flag(&|t| t.loose))?;
    let meaning = "displacement that the stone shares with its neighbours";
    vector(&mut table, "bg", "m", meaning, |t| t.shared)?;
    let meaning = "1 where the end of the section, the crown or the ground cuts the stone, else 0";
    table.push("edge", "", meaning, flag(&|t| t.edge))?;
    vector(&mut table, "n", "", "outward unit normal of the face", |t| {
        t.normal
    })?;
    push_visibility(&mut table, truths, seen)?;
    Ok(table)
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// One of the vectors of a stone.
type VectorOf = fn(&StoneTruth) -> Vector3<f64>;

fn push_visibility(table: &mut Table, truths: &[StoneTruth], seen: &[Seen]) -> Result<(), TableError> {
    let sensors = || Sensor::ALL.iter().map(|s| s.name()).enumerate();
    for (sensor, name) in sensors() {
        for (number, epoch) in (1..).zip(seen) {
            let meaning = format!("points on the stone in cloud_{name} of epoch {number}");
            let points = epoch.scans.points[sensor].clone();
            table.push(&format!("n_{name}_{number}"), "", &meaning, points)?;
        }
    }
    for (number, epoch) in (1..).zip(seen) {
        let meaning = format!("photos of epoch {number} with at least {SHOWN_PIXELS} pixels of the stone");
        table.push(&format!("n_img_{number}"), "", &meaning, epoch.photos.clone())?;
    }
    for (sensor, name) in sensors() {
        let share = |i: usize, epoch: &Seen| truths[i].seen_share(epoch.scans.cells[sensor][i]);
        let least = |i: usize| seen.iter().map(|e| share(i, e)).fold(1.0, f64::min);
        let meaning =
            format!("share of the face that cloud_{name} shows, in the epoch where it is smallest, 0 to 1");
        let shares: Vec<f64> = (0..truths.len()).map(least).collect();
        table.push(&format!("vis_{name}"), "", &meaning, shares)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_testing::check_csv_metadata;

    #[test]
    fn the_metadata_describe_every_column() {
        let folder = tempfile::tempdir().unwrap();
        let csv = folder.path().join("stones.csv");
        let scans = || SeenByScans {
            total: 0,
            points: Default::default(),
            cells: Default::default(),
        };
        let seen = || Seen {
            scans: scans(),
            photos: Vec::new(),
        };
        write_stone_table(&csv, &[], &[seen(), seen()]).unwrap();
        check_csv_metadata(&csv);
    }
}
