//! What the path over more than two epochs means: the model in time of every stone, and the four answers.

use super::time_order::{day, in_time_order, reference_share};
use crate::error::Result;
use crate::files::write_readable_json;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::until::Until;
use crate::project::{DAYS_A_YEAR, Epoch};
use crate::results::StoneRow;
use crate::results::names::{TRENDS as FILE, TRENDS_TABLE};
use crate::results::records::{InseparableRecord, TRENDS_VERSION, TrendsRecord, ZoneTrend};
use crate::verdict::inseparable_in_words;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::FaceFrame;
use stonewise_core::id::StoneId;
use stonewise_core::series::{
    PairLook, SeriesEpoch, SeriesFindings, SeriesPlace, StoneSeries, StoneTrend, Trend, analyse,
    keep_congruent,
};
use stonewise_core::stone::Stone;
use stonewise_io::table::{Table, TableError, write_parquet};

/// Writes `trends.parquet` and `trends.json` where there are more than two epochs.
pub static TRENDS: Step = Step {
    name: "trends",
    needs: &[Need::all(&MEASURE)],
    wanted: |until| until >= Until::Registered,
    applies: |project, _| project.epochs.len() > 2,
    make: |run, _| write_trends(run),
    ..Step::PLAIN
};

fn write_trends(run: &Run) -> Result<()> {
    let (context, project) = (run.context, run.context.project);
    let order = in_time_order(project);
    let epochs: Vec<SeriesEpoch> = order
        .iter()
        .map(|id| epoch(&project.epochs[*id], day(project, *id)))
        .collect();
    let first = run.labelled(EpochId::REFERENCE)?;
    let found = analyse(&epochs, &series(run, &order, &first.stones)?);
    let ids: Vec<StoneId> = first.stones.iter().map(|s| s.id).collect();
    let names: Vec<&str> = order.iter().map(|id| project.epochs[*id].name.as_str()).collect();
    write_parquet(&context.out.join(TRENDS_TABLE), &table(&ids, &found, &names)?)?;
    let language = project.settings.report.language;
    let dated = epochs.iter().filter(|e| e.years.is_some());
    let dated: Vec<String> = dated.map(|e| e.name.clone()).collect();
    let not_separable = found
        .inseparable
        .into_iter()
        .map(|inseparable| InseparableRecord {
            text: inseparable_in_words(&inseparable, dated.len(), language),
            inseparable,
        });
    let record = TrendsRecord {
        version: TRENDS_VERSION,
        zones: zones(run, &order, &found.stones)?,
        not_separable: not_separable.collect(),
        epochs: dated,
        undated: found.undated,
        terms: found.terms,
        variance_factors: found.factors,
        answers: found.answers,
    };
    write_readable_json(&context.out.join(FILE), &record)
}

/// Velocities of the zones of the newest epoch that is not the reference.
fn zones(run: &Run, order: &[EpochId], stones: &[StoneTrend]) -> Result<Vec<ZoneTrend>> {
    let Some(&newest) = order.iter().rev().find(|id| **id != EpochId::REFERENCE) else {
        return Ok(Vec::new());
    };
    let measured = run.measured(newest)?;
    let zone_of: BTreeMap<u32, u32> = measured.rows.iter().map(|r| (r.stone_id, r.zone_id)).collect();
    let mut members: BTreeMap<u32, Vec<&Trend>> = BTreeMap::new();
    for stone in stones {
        let zone = zone_of.get(&stone.stone.0).copied().unwrap_or(0);
        members.entry(zone).or_default().push(&stone.velocity);
    }
    let one = |(zone_id, members): (u32, Vec<&Trend>)| {
        let mean = |of: fn(&Trend) -> Vector3<f64>| -> [f64; 3] {
            let sum: Vector3<f64> = members.iter().map(|t| of(t)).sum();
            (sum / members.len() as f64).into()
        };
        ZoneTrend {
            epoch: run.context.project.epochs[newest].name.clone(),
            zone_id,
            stones: members.len(),
            velocity: mean(|t| t.value),
            sd: mean(|t| t.sd),
        }
    };
    Ok(members
        .into_iter()
        .filter(|(zone, _)| *zone > 0)
        .map(one)
        .collect())
}

/// The epoch with the conditions that the model takes: the first whose name has "level" or "temp" in it.
fn epoch(epoch: &Epoch, day: Option<f64>) -> SeriesEpoch {
    let condition = |part: &str| {
        let named = epoch
            .conditions
            .iter()
            .find(|(name, _)| name.to_lowercase().contains(part));
        named.map(|(_, value)| *value)
    };
    SeriesEpoch {
        name: epoch.name.clone(),
        years: day.map(|d| d / DAYS_A_YEAR),
        of_year: day.map_or(0.0, |d| (d / DAYS_A_YEAR).rem_euclid(1.0)),
        level: condition("level"),
        temperature: condition("temp"),
    }
}

/// Every stone with its deformation in each epoch, in one frame.
fn series(run: &Run, order: &[EpochId], stones: &[Stone]) -> Result<Vec<StoneSeries>> {
    let place_of: BTreeMap<StoneId, usize> = stones.iter().map(|s| s.id).zip(0..).collect();
    let place = |s: &Stone| SeriesPlace {
        place: s.centroid,
        body: 0,
        deformations: vec![None; order.len()],
    };
    let mut places: Vec<SeriesPlace> = stones.iter().map(place).collect();
    let mut shares = vec![vec![0.5; order.len()]; stones.len()];
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
                places[i].deformations[time] = Some((found.deformation, found.covariance));
                places[i].body = row.body_id.unwrap_or(0);
                shares[i][time] = reference_share(&registered.estimator, row);
            }
        }
    }
    keep_congruent(&mut places);
    let reference = order.iter().position(|id| *id == EpochId::REFERENCE).unwrap_or(0);
    let one = |((stone, place), shares): ((&Stone, &SeriesPlace), &Vec<f64>)| {
        let face = FaceFrame::from_normal(&stone.normal).face_from_world();
        let deformations = place.deformations.iter().zip(shares);
        let pairs = deformations.map(|(found, share)| {
            let (deformation, covariance) = (*found)?;
            Some(PairLook {
                value: face * deformation,
                variance: (face * covariance * face.transpose()).diagonal(),
                reference_share: *share,
            })
        });
        let pairs: Vec<Option<PairLook>> = pairs.collect();
        StoneSeries::of_pairs(stone.id, reference, &pairs)
    };
    Ok(stones.iter().zip(&places).zip(&shares).map(one).collect())
}

fn table(
    stones: &[StoneId],
    found: &SeriesFindings,
    names: &[&str],
) -> std::result::Result<Table, TableError> {
    let by_stone: BTreeMap<StoneId, &StoneTrend> = found.stones.iter().map(|s| (s.stone, s)).collect();
    let rows: Vec<Option<&StoneTrend>> = stones.iter().map(|id| by_stone.get(id).copied()).collect();
    let reals = |of: &dyn Fn(&StoneTrend) -> Option<f64>| -> Vec<Option<f64>> {
        rows.iter().map(|row| row.and_then(of)).collect()
    };
    let mut table = Table::new();
    let ids: Vec<u32> = stones.iter().map(|id| id.0).collect();
    table.push("stone_id", "", "stone of the reference", ids)?;
    let counts: Vec<Option<u32>> = rows.iter().map(|row| row.map(|r| r.epochs as u32)).collect();
    table.push(
        "epochs",
        "",
        "epochs in which it was measured, the reference among them",
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
    let step = |s: &StoneTrend| {
        s.step.map(|step| Trend {
            value: step.value,
            sd: step.sd,
            p: 0.0,
        })
    };
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

const AXES: [(&str, &str); 3] = [
    ("along", "along the wall"),
    ("up", "up the face"),
    ("out", "out of the face"),
];
