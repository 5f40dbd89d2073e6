//! What the path over more than two epochs means: the model in time of every stone, and the four answers.

use super::time_order::{day, in_time_order, reference_share};
use super::trend_groups::{TimedSeries, under};
use crate::error::Result;
use crate::files::write_readable_json;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::steps::tracks::{TRACKS, Tracked};
use crate::pipeline::until::Until;
use crate::project::Project;
use crate::results::StoneRow;
use crate::results::calendar::DAYS_A_YEAR;
use crate::results::names::{TRENDS as FILE, TRENDS_TABLE};
use crate::results::records::{InseparableRecord, TRENDS_VERSION, TrendsRecord, ZoneTrend};
use crate::verdict::inseparable_in_words;
use nalgebra::{Matrix3, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::FaceFrame;
use stonewise_core::id::StoneId;
use stonewise_core::series::{
    Estimate, PairLook, SeriesEpoch, SeriesFindings, SeriesPlace, StoneSeries, StoneTrend, Trend, analyse,
    keep_congruent,
};
use stonewise_core::stone::Stone;
use stonewise_io::table::{Table, TableError, write_parquet};

/// Writes `trends.parquet` and `trends.json` where there are more than two epochs.
pub static TRENDS: Step = Step {
    name: "trends",
    needs: &[Need::same(&TRACKS)],
    wanted: |until| until >= Until::Registered,
    applies: |project, _| project.epochs.len() > 2,
    make: |run, _| write_trends(run),
    ..Step::PLAIN
};

fn write_trends(run: &Run) -> Result<()> {
    let (context, project) = (run.context, run.context.project);
    let order = in_time_order(project);
    let epoch = |id: &EpochId| {
        let epoch = &project.epochs[*id];
        under(&epoch.conditions, &epoch.name, day(project, *id))
    };
    let epochs: Vec<SeriesEpoch> = order.iter().map(epoch).collect();
    let first = run.labelled(EpochId::REFERENCE)?;
    let tracked = run.tracked()?;
    let stones = series(run, &order, &first.stones, &tracked)?;
    let named = zones_by_epoch(run, &order)?;
    let all_zones: Vec<BTreeSet<StoneId>> = named
        .iter()
        .flat_map(|(_, zones)| zones.values().cloned())
        .collect();
    let found = analyse(&epochs, &stones, &all_zones);
    let ids: Vec<StoneId> = first.stones.iter().map(|s| s.id).collect();
    let all: Vec<StoneId> = stones.iter().map(|s| s.stone).collect();
    let names: Vec<&str> = order.iter().map(|id| project.epochs[*id].name.as_str()).collect();
    write_parquet(&context.out.join(TRENDS_TABLE), &table(&all, &found, &names)?)?;
    let timed = TimedSeries {
        project,
        order: &order,
        epochs: &epochs,
        found: &found,
        stones: &stones,
    };
    let language = project.settings.report.language;
    let dated: Vec<String> = epochs
        .iter()
        .filter(|e| e.years.is_some())
        .map(|e| e.name.clone())
        .collect();
    let not_separable = found.inseparable.iter().map(|inseparable| InseparableRecord {
        text: inseparable_in_words(inseparable, dated.len(), language),
        inseparable: inseparable.clone(),
    });
    let record = TrendsRecord {
        version: TRENDS_VERSION,
        not_separable: not_separable.collect(),
        terms: found.terms().to_vec(),
        basis: found.basis.clone(),
        conditions: timed.conditions(),
        variance_factors: found.factors,
        wall: timed.wall(&ids.iter().copied().collect()),
        zones: zones(&named, &timed),
        epochs: dated,
        undated: found.undated.clone(),
        answers: found.answers.clone(),
    };
    write_readable_json(&context.out.join(FILE), &record)
}

/// The stones of each zone by its number.
type Zones = BTreeMap<u32, BTreeSet<StoneId>>;

/// The zones of deformation of the epochs that show any, the newest first.
fn zones_by_epoch(run: &Run, order: &[EpochId]) -> Result<Vec<(EpochId, Zones)>> {
    let mut by_epoch = Vec::new();
    for id in order.iter().rev().filter(|id| !id.is_reference()) {
        let mut zones = Zones::new();
        for row in run.measured(*id)?.rows.iter().filter(|r| r.zone_id > 0) {
            zones
                .entry(row.zone_id)
                .or_default()
                .insert(StoneId(row.stone_id));
        }
        if !zones.is_empty() {
            by_epoch.push((*id, zones));
        }
    }
    Ok(by_epoch)
}

/// The zones of the newest epoch that shows any, with the other epochs that confirm them.
fn zones(by_epoch: &[(EpochId, Zones)], timed: &TimedSeries) -> Vec<ZoneTrend> {
    let Some(((newest, zones), others)) = by_epoch.split_first() else {
        return Vec::new();
    };
    let name = |id: &EpochId| timed.project.epochs[*id].name.as_str();
    let confirmed = |stones: &BTreeSet<StoneId>| {
        let others = others.iter().filter(|(_, zones)| {
            let shown = stones.iter().filter(|s| zones.values().any(|z| z.contains(s)));
            2 * shown.count() >= stones.len()
        });
        others.rev().map(|(id, _)| name(id).to_owned()).collect()
    };
    let zone = |(id, stones): (&u32, &BTreeSet<StoneId>)| {
        Some(ZoneTrend {
            confirmed_by: confirmed(stones),
            ..timed.of(stones, name(newest), *id)?
        })
    };
    zones.iter().filter_map(zone).collect()
}

/// Every stone with its deformation in each epoch, in one frame.
fn series(run: &Run, order: &[EpochId], stones: &[Stone], tracked: &Tracked) -> Result<Vec<StoneSeries>> {
    let place_of: BTreeMap<StoneId, usize> = stones.iter().map(|s| s.id).zip(0..).collect();
    let place = |s: &Stone| SeriesPlace {
        place: s.centroid,
        deformations: vec![None; order.len()],
    };
    let mut places: Vec<SeriesPlace> = stones.iter().map(place).collect();
    let mut shares = vec![vec![0.5; order.len()]; stones.len()];
    let mut smoothed = vec![Vector3::zeros(); stones.len()];
    for (time, id) in order
        .iter()
        .enumerate()
        .filter(|(_, id)| **id != EpochId::REFERENCE)
    {
        let (registered, measured) = (run.registered(*id)?, run.measured(*id)?);
        let rows: BTreeMap<u32, &StoneRow> = measured.rows.iter().map(|r| (r.stone_id, r)).collect();
        for found in registered.deformation.iter().flat_map(|d| &d.stones) {
            let row = rows.get(&found.stone.0).filter(|row| row.motion.is_some());
            if let (Some(&i), Some(row)) = (place_of.get(&found.stone), row) {
                places[i].deformations[time] = Some((found.deformation, found.covariance_without_zones()));
                if let Some(years) = years_apart(run.context.project, *id) {
                    let face = FaceFrame::from_normal(&stones[i].normal).face_from_world();
                    let own = (face * found.smoothed * face.transpose()).diagonal();
                    // The latest epoch that shows a zone there says the most about its velocity.
                    if own.max() > 0.0 {
                        smoothed[i] = own.map(|v| v.max(0.0).sqrt()) / years;
                    }
                }
                shares[i][time] = reference_share(&registered.estimator, row);
            }
        }
    }
    keep_congruent(&mut places);
    let reference = order.iter().position(|id| *id == EpochId::REFERENCE).unwrap_or(0);
    let one = |i: usize| {
        let pairs: Vec<Option<PairLook>> = places[i]
            .deformations
            .iter()
            .zip(&shares[i])
            .map(|(found, share)| Some(look(&stones[i], &(*found)?, *share)))
            .collect();
        StoneSeries {
            smoothed: smoothed[i],
            ..StoneSeries::of_pairs(stones[i].id, reference, &pairs)
        }
    };
    let mut all: Vec<StoneSeries> = (0..stones.len()).map(one).collect();
    all.extend(tracked_series(
        order,
        tracked,
        &|stone, time| match time == reference {
            true => Some(Vector3::zeros()),
            false => Some(places[*place_of.get(&stone)?].deformations[time]?.0),
        },
    ));
    Ok(all)
}

/// Years between the reference and an epoch; `None` where a date is missing, or both are of one day.
fn years_apart(project: &Project, epoch: EpochId) -> Option<f64> {
    let days = day(project, epoch)? - day(project, EpochId::REFERENCE)?;
    (days != 0.0).then(|| days.abs() / DAYS_A_YEAR)
}

/// The stones that the reference does not show. `deformation`: of a stone of the reference at a time, in the frame of the
/// series.
fn tracked_series(
    order: &[EpochId],
    tracked: &Tracked,
    deformation: &dyn Fn(StoneId, usize) -> Option<Vector3<f64>>,
) -> Vec<StoneSeries> {
    let time = |id: EpochId| order.iter().position(|o| *o == id).unwrap_or(0);
    let mut looks: BTreeMap<StoneId, Vec<Option<PairLook>>> = tracked
        .stones
        .iter()
        .map(|s| (s.stone.id, vec![None; order.len()]))
        .collect();
    let stones: BTreeMap<StoneId, &Stone> = tracked.stones.iter().map(|s| (s.stone.id, &s.stone)).collect();
    for pair in &tracked.pairs {
        let [first, later] = pair.epochs.map(time).into_array();
        let known = |stone: StoneId| Some(deformation(stone, later)? - deformation(stone, first)?);
        let found = pair.deformations(known);
        for row in pair.rows.iter().filter(|row| row.motion.is_some()) {
            let id = StoneId(row.stone_id);
            if let (Some(found), Some(stone), Some(looks)) =
                (found.get(&id), stones.get(&id), looks.get_mut(&id))
            {
                looks[later] = Some(look(stone, found, reference_share(&pair.estimator, row)));
            }
        }
    }
    let series = tracked.stones.iter();
    series
        .map(|s| StoneSeries::of_pairs(s.stone.id, time(s.since), &looks[&s.stone.id]))
        .collect()
}

/// What a pair of epochs shows of a stone: its deformation with its covariance, world.
fn look(
    stone: &Stone,
    (deformation, covariance): &(Vector3<f64>, Matrix3<f64>),
    reference_share: f64,
) -> PairLook {
    let face = FaceFrame::from_normal(&stone.normal).face_from_world();
    PairLook {
        value: face * deformation,
        variance: (face * covariance * face.transpose()).diagonal(),
        reference_share,
    }
}

fn table(
    stones: &[StoneId],
    found: &SeriesFindings,
    names: &[&str],
) -> std::result::Result<Table, TableError> {
    let by_stone: BTreeMap<StoneId, &StoneTrend> = found.stones.iter().map(|s| (s.stone, s)).collect();
    let departures: BTreeMap<StoneId, Trend> = found.departures.iter().copied().collect();
    let rows: Vec<Option<&StoneTrend>> = stones.iter().map(|id| by_stone.get(id).copied()).collect();
    let reals = |of: &dyn Fn(&StoneTrend) -> Option<f64>| -> Vec<Option<f64>> {
        rows.iter().map(|row| row.and_then(of)).collect()
    };
    let mut table = Table::new();
    let ids: Vec<u32> = stones.iter().map(|id| id.0).collect();
    table.push("stone_id", "", "stone, as in series.parquet", ids)?;
    let counts: Vec<Option<u32>> = rows.iter().map(|row| row.map(|r| r.epochs as u32)).collect();
    table.push(
        "epochs",
        "",
        "number of epochs in which it was measured, including the one from which its motion is measured",
        counts,
    )?;
    let mut add = |name: &str, unit: &str, meaning: &str, of: &dyn Fn(&StoneTrend) -> Option<Trend>| {
        let pick =
            |sd: bool, axis: usize| reals(&|s| of(s).map(|t| if sd { t.sd[axis] } else { t.value[axis] }));
        for (axis, (end, words)) in AXES.into_iter().enumerate() {
            table.push(
                &format!("{name}_{end}"),
                unit,
                &format!("{meaning}, {words}"),
                pick(false, axis),
            )?;
        }
        for (axis, (end, _)) in AXES.into_iter().enumerate() {
            let meaning = format!("standard deviation of {name}_{end}; 1.96 of them hold 95 %");
            table.push(&format!("sd_{name}_{end}"), unit, &meaning, pick(true, axis))?;
        }
        Ok::<(), TableError>(())
    };
    let velocity = "velocity against the part of the wall that kept its shape";
    add("v", "m/a", velocity, &|s| Some(s.velocity))?;
    let level = "deformation for each metre of the reservoir's level";
    add("level", "m/m", level, &|s| s.level)?;
    add("temperature", "m/K", "deformation for each degree", &|s| {
        s.temperature
    })?;
    let wave = "deformation with the yearly wave that is largest on 1 January";
    add("season_cos", "m", wave, &|s| s.season.map(|[cos, _]| cos))?;
    let wave = "deformation with the yearly wave that is largest on 1 April";
    add("season_sin", "m", wave, &|s| s.season.map(|[_, sin]| sin))?;
    let amplitude = "amplitude of the yearly wave, half of its peak-to-peak range";
    add("season_amplitude", "m", amplitude, &|s| {
        s.wave.map(|w| of_estimate(w.amplitude, 1.0))
    })?;
    let largest = "day of the yearly maximum, days since New Year";
    add("season_day", "d", largest, &|s| {
        s.wave.map(|w| of_estimate(w.phase, DAYS_A_YEAR))
    })?;
    let step = |s: &StoneTrend| {
        s.step.map(|step| Trend {
            value: step.value,
            sd: step.sd,
            p: 0.0,
        })
    };
    let departure = "newest epoch less what the others predict for it under its conditions";
    add("departure", "m", departure, &|s| {
        departures.get(&s.stone).copied()
    })?;
    add(
        "step",
        "m",
        "abrupt deformation between two epochs, where one is shown",
        &step,
    )?;
    let at: Vec<String> = rows
        .iter()
        .map(|row| {
            row.and_then(|r| r.step)
                .map_or(String::new(), |step| names[step.epoch].to_owned())
        })
        .collect();
    table.push(
        "step_epoch",
        "",
        "the first epoch after the step; empty without one",
        at,
    )?;
    let q = reals(&|s| Some(s.velocity_q));
    table.push(
        "q_v",
        "",
        "smallest false discovery rate at which the stone counts as moving in proportion to time",
        q,
    )?;
    Ok(table)
}

fn of_estimate(estimate: Estimate, factor: f64) -> Trend {
    Trend {
        value: estimate.value * factor,
        sd: estimate.sd * factor,
        p: 0.0,
    }
}

const AXES: [(&str, &str); 3] = [
    ("along", "along the wall"),
    ("up", "up the face"),
    ("out", "out of the face"),
];
