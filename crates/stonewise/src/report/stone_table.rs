//! The stone table as files.

use super::{ReportError, RowMotion, Status, StoneRow};
use nalgebra::{Matrix3, Point3, Vector3};
use std::path::Path;
use stonewise_io::table::{Cell, Column, Table, TableError, read_parquet, write_csv, write_parquet};

/// Columns of `stones.csv` and `stones.parquet`, in order.
pub const STONE_COLUMNS: [&str; 33] = [
    "stone_id",
    "x",
    "y",
    "z",
    "area_m2",
    "points_1",
    "points_2",
    "photos",
    "confidence",
    "matched_id",
    "status",
    "dx",
    "dy",
    "dz",
    "d_along",
    "d_up",
    "d_out",
    "rx",
    "ry",
    "rz",
    "cov_xx",
    "cov_xy",
    "cov_xz",
    "cov_yy",
    "cov_yz",
    "cov_zz",
    "lod95",
    "significant",
    "rel_dx",
    "rel_dy",
    "rel_dz",
    "loose",
    "sep_obs",
];

/// Writes `stones.csv` and `stones.parquet` into `dir`, rows in the order given.
///
/// # Errors
/// A file cannot be written; earlier files are kept then.
pub fn write_stones(dir: &Path, rows: &[StoneRow]) -> Result<(), ReportError> {
    write_stones_named(dir, "stones", rows)
}

/// The same under another name, for the further epochs: `stones_2.csv`, ...
///
/// # Errors
/// A file cannot be written.
pub fn write_stones_named(dir: &Path, name: &str, rows: &[StoneRow]) -> Result<(), ReportError> {
    let table = stone_table(rows)?;
    write_parquet(&dir.join(format!("{name}.parquet")), &table)?;
    write_csv(&dir.join(format!("{name}.csv")), &table)?;
    Ok(())
}

/// Reads a `stones.parquet` back.
///
/// # Errors
/// The file is missing or damaged, or lacks a column.
pub fn read_stones(path: &Path) -> Result<Vec<StoneRow>, ReportError> {
    let table = read_parquet(path)?;
    rows_of(&table, path)
}

/// Rows as a table with [`STONE_COLUMNS`].
///
/// # Errors
/// None in practice; a table refuses columns of unequal length.
pub fn stone_table(rows: &[StoneRow]) -> Result<Table, TableError> {
    let mut table = Table::new();
    for name in STONE_COLUMNS {
        table.push(name, column(name, rows))?;
    }
    Ok(table)
}

/// One column. Cells of a motion that was not measured are empty.
fn column(name: &str, rows: &[StoneRow]) -> Column {
    let float = |of: fn(&StoneRow) -> f64| rows.iter().map(of).collect::<Vec<_>>().into();
    let count = |of: fn(&StoneRow) -> u32| rows.iter().map(of).collect::<Vec<_>>().into();
    let flag = |of: fn(&RowMotion) -> bool| cells(rows, |m| u8::from(of(m)));
    let axis = |of: fn(&RowMotion) -> &Vector3<f64>, i: usize| cells(rows, move |m| of(m)[i]);
    let cov = |i: usize, j: usize| cells(rows, move |m| m.covariance[(i, j)]);
    match name {
        "stone_id" => count(|r| r.stone_id),
        "x" => float(|r| r.centroid.x),
        "y" => float(|r| r.centroid.y),
        "z" => float(|r| r.centroid.z),
        "area_m2" => float(|r| r.area_m2),
        "points_1" => count(|r| r.points_1),
        "points_2" => rows.iter().map(|r| r.points_2).collect::<Vec<_>>().into(),
        "photos" => count(|r| r.photos),
        "confidence" => float(|r| r.confidence),
        "matched_id" => rows.iter().map(|r| r.matched_id).collect::<Vec<_>>().into(),
        "status" => rows
            .iter()
            .map(|r| r.status.to_string())
            .collect::<Vec<_>>()
            .into(),
        "dx" => axis(|m| &m.displacement, 0),
        "dy" => axis(|m| &m.displacement, 1),
        "dz" => axis(|m| &m.displacement, 2),
        "d_along" => axis(|m| &m.face, 0),
        "d_up" => axis(|m| &m.face, 1),
        "d_out" => axis(|m| &m.face, 2),
        "rx" => axis(|m| &m.rotation, 0),
        "ry" => axis(|m| &m.rotation, 1),
        "rz" => axis(|m| &m.rotation, 2),
        "cov_xx" => cov(0, 0),
        "cov_xy" => cov(0, 1),
        "cov_xz" => cov(0, 2),
        "cov_yy" => cov(1, 1),
        "cov_yz" => cov(1, 2),
        "cov_zz" => cov(2, 2),
        "lod95" => cells(rows, |m| m.detection_limit_m),
        "significant" => flag(|m| m.significant),
        "rel_dx" => axis(|m| &m.relative, 0),
        "rel_dy" => axis(|m| &m.relative, 1),
        "rel_dz" => axis(|m| &m.relative, 2),
        "loose" => flag(|m| m.loose),
        _ => cells(rows, |m| m.observability),
    }
}

fn cells<T>(rows: &[StoneRow], of: impl Fn(&RowMotion) -> T) -> Column
where
    Column: From<Vec<Option<T>>>,
{
    rows.iter()
        .map(|r| r.motion.as_ref().map(&of))
        .collect::<Vec<_>>()
        .into()
}

/// Columns of one table, checked once.
struct Columns<'a>(&'a Table);

impl Columns<'_> {
    fn full<T: Cell>(&self, name: &str) -> Result<&[T], TableError> {
        self.0.required(name)
    }

    fn three(&self, names: [&str; 3]) -> Result<[Vec<Option<f64>>; 3], TableError> {
        let [a, b, c] = names.map(|n| self.0.optional(n));
        Ok([a?, b?, c?])
    }
}

fn rows_of(table: &Table, path: &Path) -> Result<Vec<StoneRow>, ReportError> {
    let columns = Columns(table);
    let (id, x, y, z) = (
        columns.full::<u32>("stone_id")?,
        columns.full("x")?,
        columns.full("y")?,
        columns.full("z")?,
    );
    let (area, confidence): (&[f64], &[f64]) = (columns.full("area_m2")?, columns.full("confidence")?);
    let (points_1, photos): (&[u32], &[u32]) = (columns.full("points_1")?, columns.full("photos")?);
    let status = columns.full::<String>("status")?;
    let (points_2, matched_id) = (table.optional("points_2")?, table.optional("matched_id")?);
    let vectors = [
        ["dx", "dy", "dz"],
        ["d_along", "d_up", "d_out"],
        ["rx", "ry", "rz"],
        ["rel_dx", "rel_dy", "rel_dz"],
    ];
    let [displacement, face, rotation, relative] = vectors.map(|names| columns.three(names));
    let (displacement, face, rotation, relative) = (displacement?, face?, rotation?, relative?);
    let (upper, lower) = (
        columns.three(["cov_xx", "cov_xy", "cov_xz"])?,
        columns.three(["cov_yy", "cov_yz", "cov_zz"])?,
    );
    let (lod95, observability) = (table.optional::<f64>("lod95")?, table.optional::<f64>("sep_obs")?);
    let (significant, loose) = (
        table.optional::<u8>("significant")?,
        table.optional::<u8>("loose")?,
    );
    let motion = |i: usize| {
        let (u, l) = (vector(&upper, i)?, vector(&lower, i)?);
        Some(RowMotion {
            displacement: vector(&displacement, i)?,
            face: vector(&face, i)?,
            rotation: vector(&rotation, i)?,
            covariance: Matrix3::new(u.x, u.y, u.z, u.y, l.x, l.y, u.z, l.y, l.z),
            relative: vector(&relative, i)?,
            detection_limit_m: lod95[i]?,
            significant: significant[i]? != 0,
            loose: loose[i]? != 0,
            observability: observability[i]?,
        })
    };
    (0..table.rows())
        .map(|i| {
            let status: Status = status[i].parse().map_err(|message| ReportError::Content {
                path: path.into(),
                message,
            })?;
            Ok(StoneRow {
                stone_id: id[i],
                centroid: Point3::new(x[i], y[i], z[i]),
                area_m2: area[i],
                points_1: points_1[i],
                points_2: points_2[i],
                photos: photos[i],
                confidence: confidence[i],
                matched_id: matched_id[i],
                status,
                motion: motion(i),
            })
        })
        .collect()
}

fn vector(columns: &[Vec<Option<f64>>; 3], row: usize) -> Option<Vector3<f64>> {
    Some(Vector3::new(columns[0][row]?, columns[1][row]?, columns[2][row]?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::testing::rows;

    /// The sentence of the contract, copied word for word.
    const CONTRACT: &str = "stone_id, x, y, z area_m2, points_1, points_2, photos, confidence, matched_id status \
        dx, dy, dz d_along, d_up, d_out rx, ry, rz cov_xx, cov_xy, cov_xz, cov_yy, cov_yz, cov_zz lod95 significant \
        rel_dx, rel_dy, rel_dz loose sep_obs";

    #[test]
    fn columns_are_those_of_the_contract_in_its_order() {
        let folder = tempfile::tempdir().unwrap();
        write_stones(folder.path(), &rows()).unwrap();
        let csv = std::fs::read_to_string(folder.path().join("stones.csv")).unwrap();
        let contract: Vec<&str> = CONTRACT.split([',', ' ']).filter(|c| !c.is_empty()).collect();
        assert_eq!(
            csv.lines().next().unwrap().split(',').collect::<Vec<_>>(),
            contract
        );
        assert!(csv.lines().any(|l| l.contains(",unmatched_lost,,,,")), "{csv}");
    }

    #[test]
    fn rows_come_back_from_parquet_as_they_were() {
        let folder = tempfile::tempdir().unwrap();
        for rows in [rows(), Vec::new()] {
            write_stones(folder.path(), &rows).unwrap();
            assert_eq!(read_stones(&folder.path().join("stones.parquet")).unwrap(), rows);
        }
        assert!(read_stones(&folder.path().join("none.parquet")).is_err());
    }
}
