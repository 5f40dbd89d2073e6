//! The columns of the stone table: one list, from which every file with stones is written, read and
//! described.

use super::{RowMotion, Status, StoneRow};
use std::path::Path;
use stonewise_base::error::{Error, Result};
use stonewise_io::table::{Column, Table};

/// A column of the stone table.
pub struct StoneColumn {
    /// Name in every file.
    pub name: &'static str,
    /// Unit; empty for counts, names and flags.
    pub unit: &'static str,
    /// What it holds.
    pub meaning: &'static str,
    cells: Cells,
}

/// Where a value lies in a row.
struct Field<R, T> {
    get: fn(&R) -> T,
    set: fn(&mut R, T),
}

/// Where the cells of a column come from, by type.
enum Cells {
    Count(Field<StoneRow, u32>),
    OptionalCount(Field<StoneRow, Option<u32>>),
    Real(Field<StoneRow, f64>),
    Status(Field<StoneRow, Status>),
    /// Empty where the stone was not measured, like all below.
    Motion(Field<RowMotion, f64>),
    OptionalMotion(Field<RowMotion, Option<f64>>),
    Flag(Field<RowMotion, bool>),
    /// Follows from other columns.
    Derived(fn(&RowMotion) -> f64),
}

macro_rules! column {
    ($kind:ident $name:literal, $unit:literal, $meaning:literal, $($field:tt)+) => {
        StoneColumn {
            name: $name,
            unit: $unit,
            meaning: $meaning,
            cells: Cells::$kind(Field { get: |row| row.$($field)+, set: |row, value| row.$($field)+ = value }),
        }
    };
}

/// All columns, in the order of the files. A new column is one line here.
#[rustfmt::skip]
pub static STONE_COLUMNS: &[StoneColumn] = &[
    column!(Count "stone_id", "", "stone of the first epoch", stone_id),
    column!(Real "x", "m", "centroid in the first epoch, world x", centroid.x),
    column!(Real "y", "m", "centroid in the first epoch, world y", centroid.y),
    column!(Real "z", "m", "centroid in the first epoch, world z", centroid.z),
    column!(Real "area_m2", "m2", "area of the visible face in the first epoch", area_m2),
    column!(Count "points_1", "", "points in the first epoch", points_1),
    column!(OptionalCount "points_2", "", "points in the later epoch; empty without a partner", points_2),
    column!(Count "photos", "", "photos and views of the first epoch that show the stone", photos),
    column!(Real "confidence", "", "mean share of the photos' votes that its points gave the stone, 0 to 1", confidence),
    column!(OptionalCount "matched_id", "", "partner in the later epoch, or empty", matched_id),
    column!(Status "status", "", "ok, or why there is no motion", status),
    column!(Motion "dx", "m", "displacement of the centroid, later epoch minus first, world x", displacement.x),
    column!(Motion "dy", "m", "displacement of the centroid, later epoch minus first, world y", displacement.y),
    column!(Motion "dz", "m", "displacement of the centroid, later epoch minus first, world z", displacement.z),
    column!(Motion "d_along", "m", "displacement along the wall, to the right of a viewer who faces it", face.x),
    column!(Motion "d_up", "m", "displacement up the face, along the batter", face.y),
    column!(Motion "d_out", "m", "displacement out of the face, towards the viewer", face.z),
    column!(Motion "rx", "rad", "rotation vector, world x", rotation.x),
    column!(Motion "ry", "rad", "rotation vector, world y", rotation.y),
    column!(Motion "rz", "rad", "rotation vector, world z", rotation.z),
    column!(Motion "cov_xx", "m2", "covariance of dx and dx; where the datum is unknown (run.json), that of the motion against the common rigid motion of the measured stones, like all of cov_, sd_, lod95 and significant", covariance.m11),
    column!(Motion "cov_xy", "m2", "covariance of dx and dy", covariance.m12),
    column!(Motion "cov_xz", "m2", "covariance of dx and dz", covariance.m13),
    column!(Motion "cov_yy", "m2", "covariance of dy and dy", covariance.m22),
    column!(Motion "cov_yz", "m2", "covariance of dy and dz", covariance.m23),
    column!(Motion "cov_zz", "m2", "covariance of dz and dz", covariance.m33),
    column!(Motion "lod95", "m", "length that a motion of this direction must exceed to be significant at 95 %", detection_limit_m),
    column!(Flag "significant", "", "1 where the motion differs from zero at 95 %, else 0", significant),
    column!(Motion "rel_dx", "m", "displacement against what the neighbours predict, world x", relative.x),
    column!(Motion "rel_dy", "m", "displacement against what the neighbours predict, world y", relative.y),
    column!(Motion "rel_dz", "m", "displacement against what the neighbours predict, world z", relative.z),
    column!(Flag "loose", "", "1 where the stone moves unlike its neighbours, significantly, else 0", loose),
    column!(Motion "sep_obs", "", "how much of its least observable direction the stone's own data show, 0 to 1", observability),
    column!(Real "along_m", "m", "place along the unrolled wall, from its left end", along_m),
    column!(Real "up_m", "m", "place up the face, from the lowest stone", up_m),
    StoneColumn { name: "length_m", unit: "m", meaning: "length of the displacement", cells: Cells::Derived(|m| m.displacement.norm()) },
    column!(Motion "sd_along", "m", "standard deviation of d_along, from the covariance of dx, dy, dz", face_sd.x),
    column!(Motion "sd_up", "m", "standard deviation of d_up", face_sd.y),
    column!(Motion "sd_out", "m", "standard deviation of d_out", face_sd.z),
    column!(OptionalMotion "p_loose", "", "probability that the stone is loose, 0 to 1; empty where the estimator gives none", p_loose),
    column!(Motion "cov_rot_xx", "rad2", "covariance of rx and rx", rotation_covariance.m11),
    column!(Motion "cov_rot_xy", "rad2", "covariance of rx and ry", rotation_covariance.m12),
    column!(Motion "cov_rot_xz", "rad2", "covariance of rx and rz", rotation_covariance.m13),
    column!(Motion "cov_rot_yy", "rad2", "covariance of ry and ry", rotation_covariance.m22),
    column!(Motion "cov_rot_yz", "rad2", "covariance of ry and rz", rotation_covariance.m23),
    column!(Motion "cov_rot_zz", "rad2", "covariance of rz and rz", rotation_covariance.m33),
    column!(Motion "cov_rel_xx", "m2", "covariance of rel_dx and rel_dx", relative_covariance.m11),
    column!(Motion "cov_rel_xy", "m2", "covariance of rel_dx and rel_dy", relative_covariance.m12),
    column!(Motion "cov_rel_xz", "m2", "covariance of rel_dx and rel_dz", relative_covariance.m13),
    column!(Motion "cov_rel_yy", "m2", "covariance of rel_dy and rel_dy", relative_covariance.m22),
    column!(Motion "cov_rel_yz", "m2", "covariance of rel_dy and rel_dz", relative_covariance.m23),
    column!(Motion "cov_rel_zz", "m2", "covariance of rel_dz and rel_dz", relative_covariance.m33),
    column!(OptionalCount "body_id", "", "part of the wall that ties between neighbours join, 1 the largest; empty where no motion was sought", body_id),
    column!(OptionalMotion "def_dx", "m", "deformation: displacement less the rigid motion of the part of the wall that kept its shape, world x; like all of def_ and sd_def_ without anything of the datum, and empty in parts of the wall of fewer than 12 stones", deformation[0]),
    column!(OptionalMotion "def_dy", "m", "deformation, world y", deformation[1]),
    column!(OptionalMotion "def_dz", "m", "deformation, world z", deformation[2]),
    column!(OptionalMotion "sd_def_along", "m", "standard deviation of the deformation along the wall", deformation_sd[0]),
    column!(OptionalMotion "sd_def_up", "m", "standard deviation of the deformation up the face", deformation_sd[1]),
    column!(OptionalMotion "sd_def_out", "m", "standard deviation of the deformation out of the face", deformation_sd[2]),
    column!(Count "zone_id", "", "zone of deformation, 0 for none", zone_id),
];

/// Columns that tables have only where a row fills them, after all others: stones that were edited by hand or
/// carried from another epoch.
#[rustfmt::skip]
pub(super) static RARE_COLUMNS: [StoneColumn; 2] = [
    column!(OptionalCount "edited", "", "number of the last edit by hand that made or changed the stone, or its partner; else empty", edited),
    column!(OptionalCount "carried_from", "", "number of the epoch whose photos show the stone, where it was carried into the other; else empty", carried_from),
];

/// The columns of a table of these rows.
pub(super) fn columns_of(rows: &[StoneRow]) -> impl Iterator<Item = &'static StoneColumn> {
    let is_filled = |column: &&StoneColumn| match &column.cells {
        Cells::OptionalCount(f) => rows.iter().any(|r| (f.get)(r).is_some()),
        _ => true,
    };
    STONE_COLUMNS.iter().chain(RARE_COLUMNS.iter().filter(is_filled))
}

impl StoneColumn {
    /// The column of these rows.
    pub(super) fn of(&self, rows: &[StoneRow]) -> Column {
        match &self.cells {
            Cells::Count(f) => rows.iter().map(f.get).collect::<Vec<u32>>().into(),
            Cells::OptionalCount(f) => rows.iter().map(f.get).collect::<Vec<Option<u32>>>().into(),
            Cells::Real(f) => rows.iter().map(f.get).collect::<Vec<f64>>().into(),
            Cells::Status(f) => rows
                .iter()
                .map(|r| (f.get)(r).to_string())
                .collect::<Vec<_>>()
                .into(),
            Cells::Motion(f) => cells(rows, |m| Some((f.get)(m))).into(),
            Cells::OptionalMotion(f) => cells(rows, |m| (f.get)(m)).into(),
            Cells::Flag(f) => cells(rows, |m| Some(u8::from((f.get)(m)))).into(),
            Cells::Derived(get) => cells(rows, |m| Some(get(m))).into(),
        }
    }

    /// Puts the cells of a table into rows; cells of motions only into rows that have one.
    ///
    /// # Errors
    /// The table lacks the column or has another type in it, a word is no status, or a measured stone's cell
    /// is empty.
    pub(super) fn fill(&self, rows: &mut [StoneRow], table: &Table, path: &Path) -> Result<()> {
        let name = self.name;
        match &self.cells {
            Cells::Count(f) => put(rows, table.required(name)?, |r, v| (f.set)(r, *v)),
            Cells::OptionalCount(f) => put(rows, &table.optional(name)?, |r, v| (f.set)(r, *v)),
            Cells::Real(f) => put(rows, table.required(name)?, |r, v| (f.set)(r, *v)),
            Cells::Status(f) => {
                for (row, word) in rows.iter_mut().zip(table.required::<String>(name)?) {
                    let status = word
                        .parse()
                        .map_err(|message: String| Error::results(path, message))?;
                    (f.set)(row, status);
                }
            }
            Cells::Motion(f) => {
                self.fill_motions(rows, &table.optional(name)?, path, |m, v| (f.set)(m, v))?
            }
            Cells::Flag(f) => {
                let cells = table.optional::<u8>(name)?;
                self.fill_motions(rows, &cells, path, |m, v| (f.set)(m, v != 0))?;
            }
            Cells::OptionalMotion(f) => put(rows, &table.optional(name)?, |r, v| {
                if let Some(motion) = r.motion.as_mut() {
                    (f.set)(motion, *v);
                }
            }),
            Cells::Derived(_) => {}
        }
        Ok(())
    }

    fn fill_motions<T: Copy>(
        &self,
        rows: &mut [StoneRow],
        cells: &[Option<T>],
        path: &Path,
        set: impl Fn(&mut RowMotion, T),
    ) -> Result<()> {
        for (row, cell) in rows.iter_mut().zip(cells) {
            if let Some(motion) = row.motion.as_mut() {
                let empty = || {
                    format!(
                        "{} of stone {} is empty, though it was measured",
                        self.name, row.stone_id
                    )
                };
                set(motion, cell.ok_or_else(|| Error::results(path, empty()))?);
            }
        }
        Ok(())
    }

    /// The value of a row as a number, NaN where the cell is empty; `None` for the column of words.
    pub fn number(&self, row: &StoneRow) -> Option<f64> {
        let motion = row.motion.as_ref();
        Some(match &self.cells {
            Cells::Count(f) => f64::from((f.get)(row)),
            Cells::OptionalCount(f) => (f.get)(row).map_or(f64::NAN, f64::from),
            Cells::Real(f) => (f.get)(row),
            Cells::Status(_) => return None,
            Cells::Motion(f) => motion.map_or(f64::NAN, f.get),
            Cells::OptionalMotion(f) => motion.and_then(f.get).unwrap_or(f64::NAN),
            Cells::Flag(f) => motion.map_or(f64::NAN, |m| f64::from(u8::from((f.get)(m)))),
            Cells::Derived(get) => motion.map_or(f64::NAN, get),
        })
    }
}

/// The column of this name.
pub fn column(name: &str) -> Option<&'static StoneColumn> {
    STONE_COLUMNS.iter().find(|c| c.name == name)
}

fn cells<T>(rows: &[StoneRow], of: impl Fn(&RowMotion) -> Option<T>) -> Vec<Option<T>> {
    rows.iter().map(|r| r.motion.as_ref().and_then(&of)).collect()
}

fn put<T>(rows: &mut [StoneRow], cells: &[T], set: impl Fn(&mut StoneRow, &T)) {
    rows.iter_mut().zip(cells).for_each(|(row, cell)| set(row, cell));
}
