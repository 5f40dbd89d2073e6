//! The M3C2 core points as cloud and table.

use crate::error::Result;
use crate::pipeline::steps::m3c2::field_table;
use crate::results::names::PairFile;
use nalgebra::Point3;
use std::path::Path;
use stonewise_core::change::{ChangeField, ChangePoint};
use stonewise_core::epoch::EpochId;
use stonewise_io::cloud::{Dimension, ExtraColumn, write_points_laz};
use stonewise_io::crs::Crs;
use stonewise_io::table::write_csv;

/// What the table of core points as a whole holds.
const DESCRIPTION: &str = "M3C2 (Lague, Brodu & Leroux 2013), one row per core point of the first epoch. Distances are later epoch minus first, \
    along the normal. Empty cells: not known.";

/// The extra dimensions of the cloud: the columns of the table after x, y and z. A LAS description has 32
/// bytes.
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
pub fn write_m3c2(dir: &Path, later: EpochId, crs: Option<&Crs>, field: &ChangeField) -> Result<()> {
    let csv = dir.join(PairFile::M3c2Csv.name(later.index()));
    write_csv(&csv, &field_table(field)?, DESCRIPTION, None)?;
    write_cloud(&dir.join(PairFile::M3c2Laz.name(later.index())), crs, field)
}

fn write_cloud(path: &Path, crs: Option<&Crs>, field: &ChangeField) -> Result<()> {
    let points = &field.points;
    let real = |of: fn(&ChangePoint) -> f64| points.iter().map(of).collect::<Vec<f64>>();
    let reals = [
        real(|p| p.normal.x),
        real(|p| p.normal.y),
        real(|p| p.normal.z),
        real(|p| p.distance_m.unwrap_or(f64::NAN)),
        real(|p| p.detection_limit_m.unwrap_or(f64::NAN)),
        real(|p| p.spread_m[0].unwrap_or(f64::NAN)),
        real(|p| p.spread_m[1].unwrap_or(f64::NAN)),
    ];
    let significant: Vec<u16> = points.iter().map(|p| u16::from(p.is_significant())).collect();
    let counts = [0, 1].map(|e| points.iter().map(|p| p.counts[e]).collect::<Vec<u32>>());
    let mut values: Vec<ExtraColumn> = reals.iter().map(|v| ExtraColumn::F64(v)).collect();
    values.push(ExtraColumn::U16(&significant));
    values.extend(counts.iter().map(|c| ExtraColumn::U32(c)));
    let columns: Vec<(Dimension, ExtraColumn)> = DIMENSIONS.into_iter().zip(values).collect();
    let positions: Vec<Point3<f64>> = points.iter().map(|p| p.position).collect();
    Ok(write_points_laz(
        path,
        crs.map(Crs::text).as_deref(),
        &positions,
        &columns,
    )?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use stonewise_testing::check_csv_metadata;

    #[test]
    fn the_metadata_describe_every_column() {
        let folder = tempfile::tempdir().unwrap();
        let field = ChangeField { points: Vec::new() };
        write_m3c2(folder.path(), EpochId::at(2), None, &field).unwrap();
        check_csv_metadata(&folder.path().join("m3c2_2.csv"));
    }

    #[test]
    fn cloud_and_table_name_and_measure_the_same() {
        let table = field_table(&ChangeField { points: Vec::new() }).unwrap();
        let unit = |name| table.description(name).unwrap().0;
        let of_table = table.names().skip(3).map(|name| (name, unit(name)));
        assert!(DIMENSIONS.iter().map(|d| (d.name, d.unit)).eq(of_table));
    }

    #[test]
    fn every_number_lies_under_its_name_in_cloud_and_table() {
        let known = ChangePoint {
            position: Point3::new(1.0, 2.0, 3.0),
            normal: Vector3::new(0.6, -0.8, 0.0),
            distance_m: Some(-0.011),
            detection_limit_m: Some(0.005),
            spread_m: [Some(0.003), Some(0.004)],
            counts: [50, 60],
        };
        let unknown = ChangePoint {
            distance_m: None,
            detection_limit_m: None,
            spread_m: [Some(0.007), None],
            counts: [8, 0],
            ..known
        };
        // In the order of the dimensions: normal, distance, limit, spreads, significant, counts.
        let nan = f64::NAN;
        let expected = [
            [0.6, -0.8, 0.0, -0.011, 0.005, 0.003, 0.004, 1.0, 50.0, 60.0],
            [0.6, -0.8, 0.0, nan, nan, 0.007, nan, 0.0, 8.0, 0.0],
        ];
        let folder = tempfile::tempdir().unwrap();
        let field = ChangeField {
            points: vec![known, unknown],
        };
        write_m3c2(folder.path(), EpochId::at(1), None, &field).unwrap();

        let csv = std::fs::read_to_string(folder.path().join("m3c2.csv")).unwrap();
        let cloud = las::Reader::from_path(folder.path().join("m3c2.laz"));
        let cloud = cloud.unwrap().read_all().unwrap();
        // Seven numbers of eight bytes, one of two and two of four.
        let extra_bytes = 7 * 8 + 2 + 2 * 4;
        let records = cloud.raw_bytes().chunks(cloud.record_len());
        for ((record, line), expected) in records.zip(csv.lines().skip(1)).zip(expected) {
            let extra = &record[record.len() - extra_bytes..];
            let (reals, rest) = extra.split_at(56);
            let reals = reals.chunks(8).map(|b| f64::from_le_bytes(b.try_into().unwrap()));
            let significant = f64::from(u16::from_le_bytes(rest[..2].try_into().unwrap()));
            let counts = rest[2..].chunks(4);
            let counts = counts.map(|b| f64::from(u32::from_le_bytes(b.try_into().unwrap())));
            let of_cloud = reals.chain([significant]).chain(counts);
            let cells = line.split(',').skip(3);
            let of_table = cells.map(|cell| {
                if cell.is_empty() {
                    nan
                } else {
                    cell.parse().unwrap()
                }
            });
            for ((cloud, table), expected) in of_cloud.zip(of_table).zip(expected) {
                let is_right =
                    |found: f64| (found - expected).abs() < 1e-7 || (found.is_nan() && expected.is_nan());
                assert!(is_right(cloud) && is_right(table), "{cloud} {table} {expected}");
            }
        }
        assert_eq!((cloud.len(), csv.lines().count()), (2, 3));
    }
}
