//! Motions of each stone over more than two epochs.

use super::time_order::{in_time_order, reference_share};
use crate::error::Result;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::until::Until;
use crate::results::names::SERIES as FILE;
use crate::results::stone_table;
use nalgebra::Matrix3;
use std::collections::BTreeMap;
use stonewise_core::epoch::EpochId;
use stonewise_core::series::covariance_between;
use stonewise_io::table::{Table, write_parquet};

/// Writes `series.parquet` where there are more than two epochs: the columns of `stones.*` after `epoch`, `date` and
/// `since`, then the covariance of the difference from the epoch before; one row for each stone of the reference and
/// each other epoch.
pub static SERIES: Step = Step {
    name: "series",
    needs: &[Need::all(&MEASURE)],
    wanted: |until| until == Until::Reported,
    applies: |project, _| project.epochs.len() > 2,
    make: |run, _| write_series(run),
    ..Step::PLAIN
};

/// Upper triangle of a covariance in the order of the columns.
const UPPER: [(usize, usize, &str); 6] = [
    (0, 0, "xx"),
    (0, 1, "xy"),
    (0, 2, "xz"),
    (1, 1, "yy"),
    (1, 2, "yz"),
    (2, 2, "zz"),
];

fn write_series(run: &Run) -> Result<()> {
    let context = run.context;
    let project = context.project;
    let (mut names, mut dates, mut rows, mut previous) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for later in project.epochs.later_ids() {
        let measured = run.measured(later)?;
        let epoch = &project.epochs[later];
        names.extend(measured.rows.iter().map(|_| epoch.name.clone()));
        dates.extend(
            measured
                .rows
                .iter()
                .map(|_| epoch.date.clone().unwrap_or_default()),
        );
        rows.extend(measured.rows.iter().cloned());
        previous.extend(of_differences(run, later)?);
    }
    let mut series = Table::new();
    series.push("epoch", "", "name of the epoch", names)?;
    series.push("date", "", "its date; empty where the project gives none", dates)?;
    let since = vec![project.epochs.reference().name.clone(); rows.len()];
    series.push("since", "", "epoch that the motion counts from", since)?;
    let stones = stone_table(&rows)?;
    for (name, column) in stones.columns() {
        let (unit, meaning) = stones.description(name).unwrap_or_default();
        series.push(name, unit, meaning, column.clone())?;
    }
    for (r, c, end) in UPPER {
        let meaning = "covariance of the difference of the displacement from that of the epoch before; empty where that \
                       did not measure the stone";
        let cells: Vec<Option<f64>> = previous
            .iter()
            .map(|m| m.map(|m: Matrix3<f64>| m[(r, c)]))
            .collect();
        series.push(&format!("cov_prev_{end}"), "m2", meaning, cells)?;
    }
    Ok(write_parquet(&context.out.join(FILE), &series)?)
}

/// Of each row of an epoch: the covariance of the difference from the epoch before, where both are known.
fn of_differences(run: &Run, later: EpochId) -> Result<Vec<Option<Matrix3<f64>>>> {
    let covariances = |epoch: EpochId| -> Result<BTreeMap<u32, (Matrix3<f64>, f64)>> {
        let (registered, measured) = (run.registered(epoch)?, run.measured(epoch)?);
        let of = measured.rows.iter().filter_map(|row| {
            let share = reference_share(&registered.estimator, row);
            Some((row.stone_id, (row.motion.as_ref()?.covariance, share)))
        });
        Ok(of.collect())
    };
    let order = in_time_order(run.context.project);
    let place = order.iter().position(|id| *id == later);
    let before = place
        .and_then(|place| place.checked_sub(1))
        .map(|place| order[place]);
    let own = covariances(later)?;
    let earlier = match before {
        Some(epoch) if epoch != EpochId::REFERENCE => covariances(epoch)?,
        _ => BTreeMap::new(),
    };
    let difference = |stone: u32| {
        let (covariance, share) = own.get(&stone)?;
        match before? {
            EpochId::REFERENCE => Some(*covariance),
            _ => {
                let (other, of_other) = earlier.get(&stone)?;
                Some(covariance_between((covariance, *share), (other, *of_other)))
            }
        }
    };
    Ok(run
        .measured(later)?
        .rows
        .iter()
        .map(|row| difference(row.stone_id))
        .collect())
}
