//! Files of stone rows: CSV with its metadata and Parquet, with the columns of the contract.

use super::columns::{RARE_COLUMNS, STONE_COLUMNS, columns_of};
use super::names::{DATA_DIR, PairFile};
use super::{Budget, RowMotion, StoneRow};
use nalgebra::Vector3;
use std::path::Path;
use stonewise_base::error::{Error, Result};
use stonewise_io::table::{
    Lists, Table, TableError, read_lists, read_parquet, write_csv_described_in, write_parquet_with,
};

/// Writes the stones of a pair of epochs into `dir`: `stones.csv` with
/// `data/stones.csv-metadata.json`, and `data/stones.parquet`; of the third epoch `data/stones_2.csv` and so on.
///
/// # Errors
/// A file cannot be written.
pub fn write_stones(dir: &Path, pair: usize, rows: &[StoneRow]) -> Result<()> {
    let table = stone_table(rows)?;
    write_parquet_with(
        &dir.join(PairFile::StonesParquet.place(pair)),
        &table,
        &budget_column(rows),
    )?;
    write_stones_csv(dir, pair, &table)
}

/// Column of the budgets, which only Parquet files have.
const BUDGET: &str = "budget";

fn budget_column(rows: &[StoneRow]) -> Lists {
    let of_row = |row: &StoneRow| {
        let sds = row.motion.iter().flat_map(|motion| motion.budget.sds());
        sds.map(|(term, sd)| (term.name().to_owned(), sd.as_slice().to_vec()))
            .collect()
    };
    Lists {
        name: BUDGET.to_owned(),
        text: "term".to_owned(),
        numbers: ["sd_along", "sd_up", "sd_out"].map(str::to_owned).to_vec(),
        rows: rows.iter().map(of_row).collect(),
    }
}

/// The budget of a row from its list.
fn budget_of(items: &[(String, Vec<f64>)]) -> std::result::Result<Budget, String> {
    let sds = items.iter().map(|(term, sd)| match sd[..] {
        [along, up, out] => Ok((term.parse()?, Vector3::new(along, up, out))),
        _ => Err(format!("{} numbers of {term:?} where 3 should be", sd.len())),
    });
    Ok(Budget::from_sds(
        sds.collect::<std::result::Result<Vec<_>, String>>()?,
    ))
}

/// Writes a stone table as text alone.
///
/// # Errors
/// A file cannot be written.
pub fn write_stones_csv(dir: &Path, pair: usize, table: &Table) -> Result<()> {
    let csv = dir.join(PairFile::StonesCsv.place(pair));
    let name = PairFile::StonesCsv.name(pair);
    let metadata = dir.join(DATA_DIR).join(format!("{name}-metadata.json"));
    let way = match pair {
        1 => format!("../{name}"),
        _ => name,
    };
    Ok(write_csv_described_in(
        [&csv, &metadata],
        &way,
        table,
        DESCRIPTION,
        Some("stone_id"),
    )?)
}

/// What the stone table as a whole holds.
const DESCRIPTION: &str = "One row per stone of the first epoch. Displacements are later epoch minus first. \
    Empty cells: not measured.";

/// Reads a `stones.parquet` back.
///
/// # Errors
/// The file is missing or damaged, or lacks a column.
pub fn read_stones(path: &Path) -> Result<Vec<StoneRow>> {
    let table = read_parquet(path)?;
    let measured = table.column("dx")?;
    let motion = |row: usize| measured.is_filled(row).then(RowMotion::default);
    let blank = |row: usize| StoneRow {
        motion: motion(row),
        ..StoneRow::default()
    };
    let mut rows: Vec<StoneRow> = (0..table.rows()).map(blank).collect();
    for column in STONE_COLUMNS {
        column.fill(&mut rows, &table, path)?;
    }
    for column in &RARE_COLUMNS {
        if table.names().any(|n| n == column.name) {
            column.fill(&mut rows, &table, path)?;
        }
    }
    let budgets = read_lists(path, BUDGET)?.map_or_else(Vec::new, |lists| lists.rows);
    for (row, items) in rows.iter_mut().zip(&budgets) {
        if let Some(motion) = &mut row.motion {
            motion.budget = budget_of(items).map_err(|reason| Error::results(path, reason))?;
        }
    }
    rows.iter_mut()
        .filter_map(|r| r.motion.as_mut())
        .for_each(RowMotion::mirror);
    Ok(rows)
}

/// Rows as a table with [`STONE_COLUMNS`], and those of rare columns that a row fills; the metadata hold
/// `NAME.unit` and `NAME.meaning` of every column.
///
/// # Errors
/// None in practice; a table refuses columns of unequal length.
pub fn stone_table(rows: &[StoneRow]) -> std::result::Result<Table, TableError> {
    let mut table = Table::new();
    for column in columns_of(rows) {
        table.push(column.name, column.unit, column.meaning, column.of(rows))?;
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Term;
    use crate::testing::rows;

    /// The sentences of the contract, copied word for word.
    const CONTRACT: &str = "stone_id, x, y, z area_m2, points_1, points_2, photos, confidence, matched_id status \
        dx, dy, dz d_along, d_up, d_out rx, ry, rz cov_xx, cov_xy, cov_xz, cov_yy, cov_yz, cov_zz lod95 significant \
        rel_dx, rel_dy, rel_dz loose sep_obs along_m, up_m length_m sd_along, sd_up, sd_out p_loose \
        cov_rot_xx cov_rot_xy cov_rot_xz cov_rot_yy cov_rot_yz cov_rot_zz \
        cov_rel_xx cov_rel_xy cov_rel_xz cov_rel_yy cov_rel_yz cov_rel_zz body_id \
        def_dx, def_dy, def_dz sd_def_along, sd_def_up, sd_def_out zone_id";

    #[test]
    fn columns_are_those_of_the_contract_in_its_order() {
        let folder = tempfile::tempdir().unwrap();
        write_stones(folder.path(), 1, &rows()).unwrap();
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
        let [mut edited, mut carried] = [rows(), rows()];
        edited[3].edited = Some(2);
        carried[1].carried_from = Some(1);
        let mut budgeted = rows();
        let sds = [
            (Term::Stone, Vector3::new(0.5, 0.25, 2.0)),
            (Term::CommonMotion, Vector3::repeat(4.0)),
        ];
        let measured = budgeted.iter_mut().filter_map(|row| row.motion.as_mut());
        measured.for_each(|motion| motion.budget = Budget::from_sds(sds));
        for rows in [rows(), Vec::new(), edited, carried, budgeted] {
            write_stones(folder.path(), 1, &rows).unwrap();
            assert_eq!(
                read_stones(&folder.path().join("data/stones.parquet")).unwrap(),
                rows
            );
        }
        assert!(read_stones(&folder.path().join("none.parquet")).is_err());
    }

    #[test]
    fn the_parquet_file_holds_unit_and_meaning_of_every_column() {
        let folder = tempfile::tempdir().unwrap();
        write_stones(folder.path(), 2, &rows()).unwrap();
        let table = read_parquet(&folder.path().join("data/stones_2.parquet")).unwrap();
        assert_eq!(table.metadata("dx.unit"), Some("m"));
        for name in table.names() {
            assert!(
                table
                    .metadata(&format!("{name}.meaning"))
                    .is_some_and(|m| !m.is_empty()),
                "{name}"
            );
        }
        assert!(folder.path().join("data/stones_2.csv-metadata.json").exists());
    }

    #[test]
    fn the_table_in_the_docs_is_the_list() {
        let lines: String = STONE_COLUMNS
            .iter()
            .map(|c| format!("| `{}` | {} | {} |\n", c.name, c.unit, c.meaning))
            .collect();
        let table = format!("| column | unit | meaning |\n| --- | --- | --- |\n{lines}");
        let docs = include_str!("../../../docs/src/results.md");
        assert!(
            docs.contains(&table),
            "docs/src/results.md should hold this table:\n{table}"
        );
    }
}
