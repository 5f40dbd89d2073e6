//! Motions of each stone over more than two epochs.

use crate::error::Result;
use crate::pipeline::context::Context;
use crate::results::names::SERIES;
use crate::results::{StoneRow, stone_table};
use stonewise_io::table::{Table, write_parquet};

/// Writes `series.parquet` where there are more than two epochs: the columns of `stones.*` after `epoch`, the
/// name of the later epoch; one row for each stone of the first epoch and each later epoch.
pub fn write_series(context: &Context, pairs: &[&[StoneRow]]) -> Result<()> {
    if pairs.len() < 2 {
        return Ok(());
    }
    let names = context.project.epochs.iter().skip(1).zip(pairs);
    let epochs: Vec<String> = names
        .flat_map(|(e, rows)| rows.iter().map(|_| e.name.clone()))
        .collect();
    let rows: Vec<StoneRow> = pairs.concat();
    let mut series = Table::new();
    series.push("epoch", "", "name of the later epoch", epochs)?;
    let stones = stone_table(&rows)?;
    for (name, column) in stones.columns() {
        let (unit, meaning) = stones.description(name).unwrap_or_default();
        series.push(name, unit, meaning, column.clone())?;
    }
    Ok(write_parquet(&context.out.join(SERIES), &series)?)
}
