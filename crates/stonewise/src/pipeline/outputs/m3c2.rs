//! The M3C2 core points as cloud and table.

use crate::error::Result;
use crate::results::names::PairFile;
use crate::results::{ColumnNote, write_csv_metadata};
use nalgebra::Point3;
use std::path::Path;
use stonewise_core::change::{ChangeField, ChangePoint};
use stonewise_io::cloud::{Dimension, ExtraColumn, write_points_laz};
use stonewise_io::crs::Crs;
use stonewise_io::table::{Table, write_csv};

/// What the table of core points as a whole holds.
const DESCRIPTION: &str = "M3C2 (Lague, Brodu & Leroux 2013), one row per core point of the first epoch. Distances are later epoch minus first, \
    along the normal. Empty cells: not known.";

/// The columns of the table.
#[rustfmt::skip]
const COLUMNS: [ColumnNote; 13] = [
    ColumnNote::new("x", "number", "m", "core point, world x"),
    ColumnNote::new("y", "number", "m", "core point, world y"),
    ColumnNote::new("z", "number", "m", "core point, world z"),
    ColumnNote::new("NormalX", "number", "", "unit normal out of the wall, world x"),
    ColumnNote::new("NormalY", "number", "", "unit normal out of the wall, world y"),
    ColumnNote::new("NormalZ", "number", "", "unit normal out of the wall, world z"),
    ColumnNote::new("m3c2_distance", "number", "m", "distance along the normal, positive out of the wall"),
    ColumnNote::new("m3c2_uncertainty", "number", "m", "95 % detection limit of the distance"),
    ColumnNote::new("m3c2_std_dev1", "number", "m", "spread of the first epoch's points along the normal"),
    ColumnNote::new("m3c2_std_dev2", "number", "m", "spread of the later epoch's points along the normal"),
    ColumnNote::new("m3c2_significant", "integer", "", "1 where the distance exceeds its detection limit, else 0"),
    ColumnNote::new("m3c2_count1", "integer", "", "points of the first epoch in the cylinder"),
    ColumnNote::new("m3c2_count2", "integer", "", "points of the later epoch in the cylinder"),
];

/// The extra dimensions of the cloud: the columns after the place, described in the 32 bytes that LAS has for
/// that.
const DIMENSIONS: [Dimension; 10] = [
    Dimension::new("NormalX", "", "unit normal, world x"),
    Dimension::new("NormalY", "", "unit normal, world y"),
    Dimension::new("NormalZ", "", "unit normal, world z"),
    Dimension::new("m3c2_distance", "m", "distance along the normal"),
    Dimension::new("m3c2_uncertainty", "m", "95 % detection limit"),
    Dimension::new("m3c2_std_dev1", "m", "spread, first epoch"),
    Dimension::new("m3c2_std_dev2", "m", "spread, later epoch"),
    Dimension::new("m3c2_significant", "", "1: beyond the detection limit"),
    Dimension::new("m3c2_count1", "", "points, first epoch"),
    Dimension::new("m3c2_count2", "", "points, later epoch"),
];

/// Writes `m3c2.laz`, `m3c2.csv` and the metadata of its columns (of the third epoch `m3c2_2.laz`, and so on)
/// with PDAL's dimension names.
///
/// In the LAZ an unknown number is NaN; in the CSV its cell is empty.
pub fn write_m3c2(dir: &Path, pair: usize, crs: Option<&Crs>, field: &ChangeField) -> Result<()> {
    let points = &field.points;
    let real = |of: fn(&ChangePoint) -> Option<f64>| points.iter().map(of).collect::<Vec<_>>();
    let columns: [(&str, Vec<Option<f64>>); 7] = [
        ("NormalX", real(|p| Some(p.normal.x))),
        ("NormalY", real(|p| Some(p.normal.y))),
        ("NormalZ", real(|p| Some(p.normal.z))),
        ("m3c2_distance", real(|p| p.distance_m)),
        ("m3c2_uncertainty", real(|p| p.detection_limit_m)),
        ("m3c2_std_dev1", real(|p| p.spread_m[0])),
        ("m3c2_std_dev2", real(|p| p.spread_m[1])),
    ];
    let significant: Vec<u16> = points.iter().map(|p| u16::from(p.is_significant())).collect();
    let counts = [0, 1].map(|e| points.iter().map(|p| p.counts[e]).collect::<Vec<u32>>());

    let mut table = Table::new();
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        table.push(
            name,
            points.iter().map(|p| p.position[axis]).collect::<Vec<f64>>(),
        )?;
    }
    for (name, values) in &columns {
        table.push(name, values.clone())?;
    }
    table.push("m3c2_significant", significant.clone())?;
    table.push("m3c2_count1", counts[0].clone())?;
    table.push("m3c2_count2", counts[1].clone())?;
    let csv = dir.join(PairFile::M3c2Csv.name(pair));
    write_csv(&csv, &table)?;
    write_csv_metadata(&csv, DESCRIPTION, None, COLUMNS)?;

    let positions: Vec<Point3<f64>> = points.iter().map(|p| p.position).collect();
    let dense: Vec<Vec<f64>> = columns
        .iter()
        .map(|(_, v)| v.iter().map(|c| c.unwrap_or(f64::NAN)).collect())
        .collect();
    let mut extra: Vec<ExtraColumn> = dense.iter().map(|v| ExtraColumn::F64(v)).collect();
    extra.push(ExtraColumn::U16(&significant));
    extra.extend(counts.iter().map(|c| ExtraColumn::U32(c)));
    let extra: Vec<(Dimension, ExtraColumn)> = DIMENSIONS.into_iter().zip(extra).collect();
    Ok(write_points_laz(
        &dir.join(PairFile::M3c2Laz.name(pair)),
        crs.map(Crs::text).as_deref(),
        &positions,
        &extra,
    )?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::check_csv_metadata;

    #[test]
    fn the_metadata_describe_every_column() {
        let folder = tempfile::tempdir().unwrap();
        let field = ChangeField { points: Vec::new() };
        write_m3c2(folder.path(), 2, None, &field).unwrap();
        check_csv_metadata(&folder.path().join("m3c2_2.csv"));
    }
}
