//! Motions of each stone over more than two epochs.

use crate::error::Result;
use crate::pipeline::context::Context;
use crate::pipeline::run::PairSummary;
use crate::report::{StoneRow, stone_table};
use stonewise_io::table::{Table, write_parquet};

/// Writes `series.parquet` where there are more than two epochs: the columns of `stones.*` after `epoch`, the
/// name of the later epoch; one row for each stone of the first epoch and each later epoch.
pub fn write_series(context: &Context, pairs: &[PairSummary]) -> Result<()> {
    if pairs.len() < 2 {
        return Ok(());
    }
    let names = context.project.epochs.iter().skip(1).zip(pairs);
    let epochs: Vec<String> = names
        .flat_map(|(e, pair)| pair.rows.iter().map(|_| e.name.clone()))
        .collect();
    let rows: Vec<StoneRow> = pairs.iter().flat_map(|pair| pair.rows.iter().cloned()).collect();
    let mut series = Table::new();
    series.push("epoch", epochs)?;
    for (name, column) in stone_table(&rows)?.columns() {
        series.push(name, column.clone())?;
    }
    Ok(write_parquet(&context.out.join("series.parquet"), &series)?)
}
