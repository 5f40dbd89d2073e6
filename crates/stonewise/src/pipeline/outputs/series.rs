//! Motions of each stone over more than two epochs.

use crate::error::Result;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::until::Until;
use crate::results::names::SERIES as FILE;
use crate::results::stone_table;
use stonewise_io::table::{Table, write_parquet};

/// Writes `series.parquet` where there are more than two epochs: the columns of `stones.*` after `epoch`, the
/// name of the later epoch; one row for each stone of the first epoch and each later epoch.
pub static SERIES: Step = Step {
    name: "series",
    needs: &[Need::all(&MEASURE)],
    wanted: |until| until == Until::Reported,
    applies: |project, _| project.epochs.len() > 2,
    make: |run, _| write_series(run),
    ..Step::PLAIN
};

fn write_series(run: &Run) -> Result<()> {
    let context = run.context;
    let (mut epochs, mut rows) = (Vec::new(), Vec::new());
    for later in context.project.epochs.later_ids() {
        let measured = run.measured(later)?;
        let name = &context.project.epochs[later].name;
        epochs.extend(measured.rows.iter().map(|_| name.clone()));
        rows.extend(measured.rows.iter().cloned());
    }
    let mut series = Table::new();
    series.push("epoch", "", "name of the later epoch", epochs)?;
    let stones = stone_table(&rows)?;
    for (name, column) in stones.columns() {
        let (unit, meaning) = stones.description(name).unwrap_or_default();
        series.push(name, unit, meaning, column.clone())?;
    }
    Ok(write_parquet(&context.out.join(FILE), &series)?)
}
