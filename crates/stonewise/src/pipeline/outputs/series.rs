//! Motions of each stone over more than two epochs.

use super::time_order::{in_time_order, reference_share};
use crate::error::Result;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::steps::tracks::{TRACKS, Tracked, TrackedPair, TrackedStone};
use crate::pipeline::until::Until;
use crate::results::names::SERIES as FILE;
use crate::results::records::EstimatorRecord;
use crate::results::{Reference, Status, StoneRow, stone_table};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::id::StoneId;
use stonewise_core::registration::StoneDeformation;
use stonewise_core::series::covariance_between;
use stonewise_core::stone::{MatchOutcome, UnmatchedReason};
use stonewise_io::table::{Table, write_parquet};

/// Writes `series.parquet` where there are more than two epochs: the columns of `stones.*` after `epoch`, `date`,
/// `since` and `state`, then the covariance of the difference from the epoch before; one row for each stone of the reference and
/// each other epoch, and for each other stone and each epoch after the first that shows it.
pub static SERIES: Step = Step {
    name: "series",
    needs: &[Need::same(&TRACKS)],
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

/// What became of a stone in an epoch.
#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    Seen,
    Hidden,
    Changed,
    Lost,
    Replaced,
    New,
}

impl State {
    fn word(self) -> &'static str {
        match self {
            Self::Seen => "seen",
            Self::Hidden => "hidden",
            Self::Changed => "changed",
            Self::Lost => "lost",
            Self::Replaced => "replaced",
            Self::New => "new",
        }
    }
}

/// A row of the table.
struct SeriesRow {
    row: StoneRow,
    state: Option<State>,
    epoch: EpochId,
    since: EpochId,
    /// Covariance of the difference from the epoch before, where both are known.
    previous: Option<Matrix3<f64>>,
}

fn write_series(run: &Run) -> Result<()> {
    let context = run.context;
    let project = context.project;
    let tracked = run.tracked()?;
    let mut all = Vec::new();

    for later in project.epochs.later_ids() {
        all.extend(of_reference(run, &tracked, later)?);
        all.extend(of_tracks(run, &tracked, later)?);
    }

    let name = |epoch: EpochId| project.epochs[epoch].name.clone();
    let mut series = Table::new();
    let names: Vec<String> = all.iter().map(|r| name(r.epoch)).collect();
    series.push("epoch", "", "name of the epoch", names)?;
    let date = |r: &SeriesRow| project.epochs[r.epoch].date.clone().unwrap_or_default();
    let dates: Vec<String> = all.iter().map(date).collect();
    series.push("date", "", "its date; empty where the project gives none", dates)?;
    let since: Vec<String> = all.iter().map(|r| name(r.since)).collect();
    series.push("since", "", "epoch from which the motion is measured", since)?;
    let state = |r: &SeriesRow| r.state.map_or(String::new(), |s| s.word().to_owned());
    let states: Vec<String> = all.iter().map(state).collect();
    let meaning = "what the epoch shows of the stone: seen, hidden, changed, lost, replaced, new; `status` says why there is no motion";
    series.push("state", "", meaning, states)?;
    let previous: Vec<Option<Matrix3<f64>>> = all.iter().map(|r| r.previous).collect();

    let rows: Vec<StoneRow> = all.into_iter().map(|r| r.row).collect();
    let stones = stone_table(&rows)?;
    for (name, column) in stones.columns() {
        let (unit, meaning) = stones.description(name).unwrap_or_default();
        series.push(name, unit, meaning, column.clone())?;
    }

    for (r, c, end) in UPPER {
        let meaning = "covariance of the difference of the displacement from that of the epoch before; empty where that \
                       did not measure the stone";
        let cells: Vec<Option<f64>> = previous.iter().map(|m| m.map(|m| m[(r, c)])).collect();
        series.push(&format!("cov_prev_{end}"), "m2", meaning, cells)?;
    }

    Ok(write_parquet(&context.out.join(FILE), &series)?)
}

/// The rows of the stones of the reference.
fn of_reference(run: &Run, tracked: &Tracked, later: EpochId) -> Result<Vec<SeriesRow>> {
    let measured = run.measured(later)?;
    let own = covariances(&run.registered(later)?.estimator, &measured.rows);
    let before = epoch_before(run, later);
    let earlier = match before.filter(|id| !id.is_reference()) {
        Some(epoch) => covariances(&run.registered(epoch)?.estimator, &run.measured(epoch)?.rows),
        None => BTreeMap::new(),
    };
    let row = |row: &StoneRow| SeriesRow {
        state: state_of(row, tracked, later),
        epoch: later,
        since: EpochId::REFERENCE,
        previous: before.and_then(|before| difference(row.stone_id, &own, before.is_reference(), &earlier)),
        row: row.clone(),
    };
    Ok(measured.rows.iter().map(row).collect())
}

/// The rows of the stones that the reference does not show, in the epochs after the first that does.
fn of_tracks(run: &Run, tracked: &Tracked, later: EpochId) -> Result<Vec<SeriesRow>> {
    let order = in_time_order(run.context.project);
    let place = |id: EpochId| order.iter().position(|o| *o == id);
    let facade = &run.outlined()?.facade;
    let before = epoch_before(run, later);
    let pair = |epochs: Pair<EpochId>| tracked.pairs.iter().find(|p| p.epochs == epochs);
    let of_pair = |pair: Option<&TrackedPair>| {
        pair.map_or_else(BTreeMap::new, |pair| covariances(&pair.estimator, &pair.rows))
    };
    let mut deformed = BTreeMap::new();
    for pair in tracked.pairs.iter().filter(|p| p.epochs.later == later) {
        deformed.insert(pair.epochs.first, pair_deformations(run, pair)?);
    }
    let mut rows = Vec::new();

    for stone in tracked.stones.iter().filter(|s| place(s.since) < place(later)) {
        let measured = pair(Pair::new(stone.since, later));
        let found = measured.and_then(|p| p.rows.iter().find(|r| r.stone_id == stone.stone.id.0));
        let is_first = { order.iter() }
            .filter(|id| place(**id) > place(stone.since))
            .find(|id| stone.seen.contains_key(*id))
            == Some(&later);
        let (row, state) = match found {
            Some(row) => {
                let deformation = deformed.get(&stone.since).and_then(|d| d.get(&stone.stone.id));
                let row = match deformation {
                    Some(found) => row.clone().with_deformation(&stone.stone.normal, found),
                    None => row.clone(),
                };
                (
                    row,
                    if stone.is_new && is_first {
                        State::New
                    } else {
                        State::Seen
                    },
                )
            }
            None => {
                let (reason, state) = match stone.missed.get(&later) {
                    Some(true) => (UnmatchedReason::Lost, State::Lost),
                    _ => (UnmatchedReason::Unseen, State::Hidden),
                };
                let outcome = MatchOutcome::Unmatched(reason);
                let at = facade.place(&stone.stone.centroid);
                let none = Reference::default();
                (
                    StoneRow::new(&stone.stone, &outcome, None, None, &none, &at),
                    state,
                )
            }
        };
        let previous = before.and_then(|before| {
            let earlier = of_pair(pair(Pair::new(stone.since, before)));
            difference(row.stone_id, &of_pair(measured), before == stone.since, &earlier)
        });
        rows.push(SeriesRow {
            row,
            state: Some(state),
            epoch: later,
            since: stone.since,
            previous,
        });
    }

    Ok(rows)
}

/// The deformations of stones that the reference does not show, in the frames of the pairs of both epochs.
fn pair_deformations(run: &Run, pair: &TrackedPair) -> Result<BTreeMap<StoneId, StoneDeformation>> {
    let of = |epoch: EpochId| -> Result<BTreeMap<StoneId, Vector3<f64>>> {
        let registered = run.registered(epoch)?;
        let stones = registered.deformation.iter().flat_map(|d| &d.stones);
        Ok(stones.map(|s| (s.stone, s.deformation)).collect())
    };
    let [first, later] = [of(pair.epochs.first)?, of(pair.epochs.later)?];
    let found = pair.deformations(|id| Some(later.get(&id)? - first.get(&id)?));
    let of_stone = |(stone, (deformation, covariance))| {
        let row = StoneDeformation {
            stone,
            deformation,
            covariance,
            smoothed: Matrix3::zeros(),
            zone: 0,
        };
        (stone, row)
    };
    Ok(found.into_iter().map(of_stone).collect())
}

/// The epoch before another.
fn epoch_before(run: &Run, later: EpochId) -> Option<EpochId> {
    let order = in_time_order(run.context.project);
    let place = order.iter().position(|id| *id == later)?;
    place.checked_sub(1).map(|place| order[place])
}

/// Covariances of the motions by stone, each with the part that the epoch brings in from which the motions count.
fn covariances(estimator: &EstimatorRecord, rows: &[StoneRow]) -> BTreeMap<u32, (Matrix3<f64>, f64)> {
    let of = |row: &StoneRow| {
        let share = reference_share(estimator, row);
        Some((row.stone_id, (row.motion.as_ref()?.covariance, share)))
    };
    rows.iter().filter_map(of).collect()
}

/// Covariance of the difference from the epoch before. `counts_from`: whether motions count from that.
fn difference(
    stone: u32,
    own: &BTreeMap<u32, (Matrix3<f64>, f64)>,
    counts_from: bool,
    earlier: &BTreeMap<u32, (Matrix3<f64>, f64)>,
) -> Option<Matrix3<f64>> {
    let (covariance, share) = own.get(&stone)?;
    if counts_from {
        return Some(*covariance);
    }
    let (other, of_other) = earlier.get(&stone)?;
    Some(covariance_between((covariance, *share), (other, *of_other)))
}

/// What became of a stone of the reference; `None` for what is no stone.
fn state_of(row: &StoneRow, tracked: &Tracked, later: EpochId) -> Option<State> {
    let is_replaced = || {
        let near = |s: &TrackedStone| {
            (s.stone.centroid - row.centroid).norm_squared() < 0.25 * row.area_m2
                && s.seen.contains_key(&later)
        };
        tracked.stones.iter().any(near)
    };
    Some(match row.status {
        Status::Ok | Status::FailedPoints | Status::FailedConvergence | Status::Unobservable => State::Seen,
        Status::UnmatchedUnseen => State::Hidden,
        Status::UnmatchedLost if is_replaced() => State::Replaced,
        Status::UnmatchedLost => State::Lost,
        Status::UnmatchedAmbiguous | Status::UnmatchedArea | Status::FailedDisagreement => State::Changed,
        Status::NotMasonry => return None,
    })
}
