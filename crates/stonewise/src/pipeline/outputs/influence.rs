//! What each source, stable area, instrument and known length does to the results of a later epoch.

use super::tables::write_registration;
use super::verdict::{VERDICT, verdict_of_project};
use crate::error::Result;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::steps::measure::Measured;
use crate::pipeline::steps::register::{length_influences, name_of, since_reference};
use crate::pipeline::until::Until;
use crate::report_params::Language;
use crate::results::StoneRow;
use crate::results::records::{EpochVerdict, InfluenceRecord, Largest};
use crate::texts::Said;
use crate::texts::notices::{KNOWN_LENGTH, LARGEST_BEYOND, RESTS_ON_ONE, STATE_CHANGES};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use stonewise_core::epoch::EpochId;
use stonewise_core::instruments::RegistrationError;
use stonewise_core::registration::observers::Member;

/// Adds to `registration.json` what the results rest on, and notes what the verdict rests on alone.
pub static INFLUENCE: Step = Step {
    name: "influence",
    needs: &[Need::same(&VERDICT)],
    wanted: |until| until >= Until::Registered,
    make: |run, _| write_influence(run),
    ..Step::PLAIN
};

fn write_influence(run: &Run) -> Result<()> {
    let project = run.context.project;
    let verdict = run.verdict()?;
    let mut all = Vec::new();
    for (later, on_epoch) in project.epochs.later_ids().zip(&verdict.epochs) {
        let measured = run.measured(later)?;
        let supports = supports(run, later, &measured)?;
        let largest = on_epoch.wall.largest.as_ref();
        let record = |support: &Support| support.record(&measured, largest, project.settings.report.language);
        if !supports.is_empty() {
            write_registration(run, later, supports.iter().map(record).collect())?;
        }
        all.push((later, on_epoch, measured, supports));
    }

    // The verdict without that on which the motions of each epoch depend most.
    let most = |(later, _, _, supports): &(EpochId, _, _, Vec<Support>)| {
        Some((later.index(), most_influential(supports)?.shifts.clone()?))
    };
    let shifts: BTreeMap<usize, BTreeMap<u32, Vector3<f64>>> = all.iter().filter_map(most).collect();
    if shifts
        .values()
        .flatten()
        .all(|(_, shift)| *shift == Vector3::zeros())
    {
        return Ok(());
    }
    let without = verdict_of_project(run.context, &|pair, stones| {
        for (id, shift) in shifts.get(&pair).into_iter().flatten() {
            if let Ok(k) = stones.binary_search_by_key(id, |row| row.stone_id)
                && let Some(motion) = &mut stones[k].motion
            {
                motion.displacement += shift;
            }
        }
    })?;
    for ((later, on_epoch, measured, supports), without) in all.iter().zip(&without.epochs) {
        if let Some(message) = rests_on_one(supports, measured, on_epoch, without) {
            let epoch = &project.epochs[*later].name;
            run.context.warnings.notice(INFLUENCE.name, epoch, message);
        }
    }
    Ok(())
}

/// What takes part in the datum of a later epoch or in its scale.
struct Support {
    name: Said,
    redundancy: f64,
    smallest_blunder_m: Option<f64>,
    /// What leaving it out adds to the motions of the measured stones that something else shows, world, metres; `None`
    /// where the datum would be unknown or is not estimated.
    shifts: Option<BTreeMap<u32, Vector3<f64>>>,
}

impl Support {
    fn record(&self, measured: &Measured, largest: Option<&Largest>, language: Language) -> InfluenceRecord {
        InfluenceRecord {
            name: self.name.text(language).to_owned(),
            redundancy: rounded(self.redundancy),
            smallest_blunder_mm: self.smallest_blunder_m.map(|m| rounded(1e3 * m)),
            largest_motion_without_mm: largest.and_then(|l| self.length_mm(measured, l.stone_id)),
            shift_mm: self.shifts.as_ref().map(|_| rounded(1e3 * self.shift_m())),
        }
    }

    /// The largest change of a stone's motion without it.
    fn shift_m(&self) -> f64 {
        let shifts = self.shifts.iter().flat_map(BTreeMap::values);
        shifts.map(Vector3::norm).fold(0.0, f64::max)
    }

    /// Length of a stone's motion without it, as the verdict counts it.
    fn length_mm(&self, measured: &Measured, stone: u32) -> Option<f64> {
        let shift = self.shifts.as_ref()?.get(&stone)?;
        let row = measured.rows.iter().find(|row| row.stone_id == stone)?;
        let common = measured.datum.common_motion_at(&row.centroid).unwrap_or_default();
        let motion = row.motion.as_ref()?.displacement - common;
        Some(rounded(1e3 * (motion + shift).norm()))
    }
}

/// Everything that takes part in the datum of a later epoch or in its scale.
fn supports(run: &Run, later: EpochId, measured: &Measured) -> Result<Vec<Support>> {
    let (project, registered) = (run.context.project, run.registered(later)?);
    let epochs = since_reference(later);
    let of_rows = |shift: &dyn Fn(&StoneRow) -> Option<Vector3<f64>>| -> BTreeMap<u32, Vector3<f64>> {
        let rows = measured.rows.iter().filter(|row| row.motion.is_some());
        rows.filter_map(|row| Some((row.stone_id, shift(row)?))).collect()
    };
    // Instruments in use take up what they show of a change.
    let left = |shifts: BTreeMap<u32, Vector3<f64>>| {
        let at = |stone: u32| shifts.get(&stone).copied().unwrap_or_default();
        match measured.in_use.as_ref().and_then(|in_use| in_use.following(at)) {
            Some(error) => of_rows(&|row| Some(shifts.get(&row.stone_id)? - error.at(&row.centroid))),
            None => shifts,
        }
    };

    let mut all = Vec::new();
    if let Some(errors) = &registered.epoch_errors {
        for influence in &errors.influences {
            let name = match influence.of {
                Member::Source(k) => errors.sources.get(k).map(|source| {
                    let epoch = epochs.into_array()[source.epoch];
                    format!("{}: {}", project.epochs[epoch].name, source.name).into()
                }),
                Member::Area(area) => Some(name_of(run.context, &registered, area)),
            };
            let at_stones = |shifts: &Vec<Option<Vector3<f64>>>| {
                let ids = registered.error_stones.iter().map(|stone| stone.0);
                let by_stone: BTreeMap<u32, Option<Vector3<f64>>> = ids.zip(shifts.iter().copied()).collect();
                left(of_rows(&|row| *by_stone.get(&row.stone_id)?))
            };
            all.extend(name.map(|name| {
                Support {
                    name,
                    redundancy: influence.redundancy,
                    smallest_blunder_m: influence.smallest_blunder_m,
                    shifts: { influence.shifts.as_ref() }
                        .filter(|_| measured.is_estimated)
                        .map(at_stones),
                }
            }));
        }

        if let Some(scale) = &errors.scale {
            for length in length_influences(project, epochs)? {
                let distance = length.distance;
                let values = [
                    ("length_m", Said::numbers(format!("{:.3}", distance.length_m))),
                    ("epoch", project.epochs[distance.epoch].name.as_str().into()),
                ];
                let shift = |row: &StoneRow| Some((scale.centre - row.centroid) * length.change);
                all.push(Support {
                    name: KNOWN_LENGTH.say(&values),
                    redundancy: length.redundancy,
                    smallest_blunder_m: length.smallest_blunder_m,
                    shifts: Some(left(of_rows(&shift))),
                });
            }
        }
    }

    for instrument in measured.in_use.iter().flat_map(|in_use| in_use.influences()) {
        let shifts = |change: RegistrationError| of_rows(&|row| Some(-change.at(&row.centroid)));
        all.push(Support {
            name: instrument.name.into(),
            redundancy: instrument.tested.redundancy,
            smallest_blunder_m: instrument.tested.smallest_blunder_m,
            shifts: instrument.change.map(shifts),
        });
    }
    Ok(all)
}

/// That on which the motions depend most.
fn most_influential(supports: &[Support]) -> Option<&Support> {
    supports.iter().max_by(|a, b| a.shift_m().total_cmp(&b.shift_m()))
}

/// The sentence that names the one thing without which the largest motion would lie outside its interval or the state
/// would be another; `without`: the verdict without that on which the motions depend most.
fn rests_on_one(
    supports: &[Support],
    measured: &Measured,
    now: &EpochVerdict,
    without: &EpochVerdict,
) -> Option<Said> {
    let say = |support: &Support, change: Said| {
        RESTS_ON_ONE.say(&[("name", support.name.clone()), ("change", change)])
    };
    let beyond = now.wall.largest.as_ref().and_then(|largest| {
        let [low, high] = largest.interval_mm;
        let lengths = supports
            .iter()
            .filter_map(|s| Some((s, s.length_mm(measured, largest.stone_id)?)));
        let beyond = lengths.filter(|(_, mm)| !(low..=high).contains(mm));
        let off = |mm: f64| (mm - largest.length_mm).abs();
        let (support, mm) = beyond.max_by(|a, b| off(a.1).total_cmp(&off(b.1)))?;
        let values = [("without_mm", mm), ("low_mm", low), ("high_mm", high)];
        let values = values.map(|(name, mm)| (name, Said::numbers(format!("{mm:.1}"))));
        Some(say(support, LARGEST_BEYOND.say(&values)))
    });
    beyond.or_else(|| {
        let most = most_influential(supports)?;
        (without.state != now.state).then(|| say(most, (&STATE_CHANGES).into()))
    })
}

/// To a thousandth.
fn rounded(value: f64) -> f64 {
    (1e3 * value).round() / 1e3
}
