//! Other instruments beside the stones around them, and what those in use say of the datum.

use crate::error::Result;
use crate::pipeline::context::Context;
use crate::project::{AxisMotion, NetworkFile, Project, ReadingGap};
use crate::report_params::Language;
use crate::results::records::{
    ComparedInstrument, Datum, DatumState, DatumUse, InstrumentsEpoch, LeftOutInstrument, WhyLeftOut,
};
use crate::results::{Reference, RowMotion, StoneRow, Term};
use crate::texts::Said;
use crate::texts::notices::{
    DATUM_INSTRUMENTS, INSTRUMENTS_CONTRADICTED, INSTRUMENTS_DISAGREE, INSTRUMENTS_LEFT_OUT,
    INSTRUMENTS_UNDETERMINED,
};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Point3, Vector3, Vector6};
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_core::epoch::EpochId;
use stonewise_core::id::StoneId;
use stonewise_core::instruments::{Agreement, Difference, RegistrationError, Tested, agreement};
use stonewise_core::linalg::without_negative;

/// Name of the step in warnings.
const STEP: &str = "instruments";
/// Stones around an instrument whose mean motion is compared with it.
const STONES: usize = 3;
/// Probability below which instruments and stones, or one of them, disagree.
const LEVEL: f64 = 0.05;
/// Probability below which the instruments in use, tested together, are not used.
const CONTRADICTED: f64 = 0.001;

/// An instrument, and what it moved.
struct Moved<'a> {
    name: &'a str,
    place: Point3<f64>,
    file: &'a Path,
    is_used: bool,
    reach_m: f64,
    motion: std::result::Result<[Option<AxisMotion>; 3], ReadingGap>,
}

/// An instrument with the stones around it.
struct Beside<'a> {
    instrument: Moved<'a>,
    motion: [Option<AxisMotion>; 3],
    stones: Vec<&'a StoneRow>,
    /// Their mean motion, metres.
    mean: Vector3<f64>,
    difference: Difference,
}

/// What is known of a later epoch before instruments say anything.
pub struct Before<'a> {
    /// The registration.
    pub datum: &'a mut Datum,
    /// The stones of the reference.
    pub rows: &'a mut [StoneRow],
    /// The rigid part of the registration error that was taken off the motions, about the centre of the datum.
    pub taken_off: Vector6<f64>,
}

/// The instruments that are observations of the datum.
pub struct InUse {
    centre: Point3<f64>,
    /// Covariance of the registration before they were used.
    known: Option<Matrix6<f64>>,
    /// Covariance of the differences, m^2: three rows for each.
    errors: DMatrix<f64>,
    list: Vec<Used>,
}

struct Used {
    name: String,
    /// The stones around it.
    stones: Vec<u32>,
    difference: Difference,
}

/// What an instrument in use does to the results.
pub struct InstrumentInfluence<'a> {
    /// Its name.
    pub name: &'a str,
    /// How it agrees with the others.
    pub tested: Tested,
    /// What leaving it out adds to the registration error that is taken off; `None` where the others do not determine it.
    pub change: Option<RegistrationError>,
}

impl InUse {
    /// What each of them does to the results.
    pub fn influences(&self) -> Vec<InstrumentInfluence<'_>> {
        let Some(all) = self.agreement(|_| true, |used| used.difference.clone()) else {
            return Vec::new();
        };
        let of_one = |(k, tested): (usize, &Tested)| {
            let rest = self.agreement(|other| other != k, |used| used.difference.clone());
            let is_determined = rest
                .as_ref()
                .map_or(self.known.is_some(), |rest| use_of(rest) == DatumUse::Observed);
            let mean = rest.map_or_else(Vector6::zeros, |rest| rest.error.mean);
            InstrumentInfluence {
                name: &self.list[k].name,
                tested: tested.clone(),
                change: is_determined.then(|| RegistrationError {
                    mean: mean - all.error.mean,
                    ..all.error.clone()
                }),
            }
        };
        all.instruments.iter().enumerate().map(of_one).collect()
    }

    /// What they add to the registration error that is taken off where the motions of stones before change by `shift`,
    /// metres.
    pub fn following(&self, shift: impl Fn(u32) -> Vector3<f64>) -> Option<RegistrationError> {
        let shifted = |used: &Used| {
            let sum: Vector3<f64> = used.stones.iter().map(|stone| shift(*stone)).sum();
            let mean = sum / used.stones.len().max(1) as f64;
            Difference {
                value: [0, 1, 2].map(|axis| used.difference.value[axis].map(|_| mean[axis])),
                ..used.difference.clone()
            }
        };
        Some(self.agreement(|_| true, shifted)?.error)
    }

    fn agreement(
        &self,
        is_kept: impl Fn(usize) -> bool,
        difference: impl Fn(&Used) -> Difference,
    ) -> Option<Agreement> {
        let kept: Vec<usize> = (0..self.list.len()).filter(|&k| is_kept(k)).collect();
        let differences: Vec<Difference> = kept.iter().map(|&k| difference(&self.list[k])).collect();
        let errors = of_differences(&self.errors, &kept);
        agreement(&differences, &errors, &self.centre, self.known.as_ref())
    }
}

/// Compares instruments with the stones of a later epoch; those in use, which are returned, change the datum and the
/// rows. `None` without instruments.
///
/// # Errors
/// A network of which no point lies at the wall.
pub fn compare(
    project: &Project,
    later: EpochId,
    before: Before,
    normals: &Normals,
) -> Result<Option<(InstrumentsEpoch, Option<InUse>)>> {
    if project.instrument_files().next().is_none() {
        return Ok(None);
    }
    if let Some(network) = project.network(later) {
        check_network(network, before.rows)?;
    }
    let mut record = InstrumentsEpoch {
        epoch: project.epochs[later].name.clone(),
        ..InstrumentsEpoch::default()
    };
    let (instruments, readings) = instruments(project, later);
    let (beside, covariance) = beside(
        instruments,
        &readings,
        before.rows,
        before.datum,
        &mut record.left_out,
    );
    let centre = Point3::from(before.datum.centre);
    let known = before.datum.covariance();
    let with = |which: &dyn Fn(&Beside) -> bool| {
        let chosen: Vec<usize> = (0..beside.len()).filter(|&i| which(&beside[i])).collect();
        let differences: Vec<Difference> = chosen.iter().map(|&i| beside[i].difference.clone()).collect();
        agreement(
            &differences,
            &of_differences(&covariance, &chosen),
            &centre,
            known.as_ref(),
        )
    };

    if let Some(all) = with(&|_| true) {
        record.p = all.p;
        record.compared = compared(&beside, &all);
    }

    let in_use = with(&|b| b.instrument.is_used);
    record.datum = in_use.as_ref().map(use_of);
    let used = |b: &Beside| Used {
        name: b.instrument.name.to_owned(),
        stones: b.stones.iter().map(|s| s.stone_id).collect(),
        difference: b.difference.clone(),
    };
    let list: Vec<usize> = (0..beside.len())
        .filter(|&i| beside[i].instrument.is_used)
        .collect();
    let used = InUse {
        centre,
        known,
        errors: of_differences(&covariance, &list),
        list: list.iter().map(|&i| used(&beside[i])).collect(),
    };
    let is_observed = record.datum == Some(DatumUse::Observed);
    if let Some(found) = in_use.filter(|_| is_observed) {
        let count = record.compared.iter().filter(|c| c.is_used).count();
        update(
            before,
            &found.error,
            normals,
            count,
            project.settings.report.language,
        );
    }

    Ok(Some((record, is_observed.then_some(used))))
}

/// Outward normals of stones.
pub type Normals = BTreeMap<StoneId, Vector3<f64>>;

/// All instruments with what they moved from the reference to a later epoch, and the covariance of the readings, m^2:
/// three rows for each.
fn instruments(project: &Project, later: EpochId) -> (Vec<Moved<'_>>, DMatrix<f64>) {
    let dates = [EpochId::REFERENCE, later].map(|id| project.epochs[id].date.as_deref());
    let mut all = Vec::new();
    for file in &project.instruments {
        all.extend(file.instruments.iter().map(|instrument| Moved {
            name: &instrument.name,
            place: instrument.place,
            file: &file.path,
            is_used: file.is_used,
            reach_m: file.reach_m,
            motion: file.motion(instrument, dates),
        }));
    }
    let first_point = all.len();
    let networks = project.network(EpochId::REFERENCE).zip(project.network(later));
    let network = networks.map(|(first, later)| (later, later.motion_since(first)));
    if let Some((file, found)) = &network {
        all.extend(found.points.iter().map(|point| Moved {
            name: point.name,
            place: point.place,
            file: file.path(),
            is_used: file.is_used,
            reach_m: file.reach_m,
            motion: point.motion,
        }));
    }

    let motions = all.iter().flat_map(|i| i.motion.unwrap_or_default());
    let variances = motions.map(|m| m.map_or(0.0, |m| m.variance_m2));
    let mut covariance = DMatrix::from_diagonal(&DVector::from_iterator(3 * all.len(), variances));
    if let Some((_, found)) = network {
        let start = (3 * first_point, 3 * first_point);
        covariance
            .view_mut(start, found.covariance.shape())
            .copy_from(&found.covariance);
    }
    (all, covariance)
}

/// An error where no point of the network lies near a stone: it is in another frame than the clouds.
fn check_network(network: &NetworkFile, rows: &[StoneRow]) -> Result<()> {
    let distance_m = |place: &Point3<f64>| {
        let distances = rows.iter().map(|row| (row.centroid - place).norm());
        distances.filter(|d| d.is_finite()).reduce(f64::min)
    };
    let points = network.network.points.iter();
    let nearest = points
        .filter_map(|p| Some((distance_m(&p.place)?, p)))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    match nearest {
        Some((distance_m, point)) if distance_m > network.reach_m => Err(network.error(format!(
            "no point of {} lies within reach_m = {} m of a stone; the nearest, {}, lies {distance_m:.1} m away: bring the \
             network to the frame of the clouds",
            network.path().display(),
            network.reach_m,
            point.name
        ))),
        _ => Ok(()),
    }
}

/// The instruments that can be compared, and the covariance of their differences from the stones without the
/// registration error, m^2: three rows for each.
fn beside<'a>(
    instruments: Vec<Moved<'a>>,
    readings: &DMatrix<f64>,
    rows: &'a [StoneRow],
    datum: &Datum,
    left_out: &mut Vec<LeftOutInstrument>,
) -> (Vec<Beside<'a>>, DMatrix<f64>) {
    let (mut all, mut chosen, mut stone_errors) = (Vec::new(), Vec::new(), Vec::new());
    for (k, instrument) in instruments.into_iter().enumerate() {
        let stones = around(&instrument, rows);
        let motion = instrument.motion.map_err(why);
        let motion = match motion {
            Ok(motion) if !stones.is_empty() => motion,
            found => {
                let reach_m = instrument.reach_m;
                left_out.push(LeftOutInstrument {
                    name: instrument.name.to_owned(),
                    file: file_name(instrument.file),
                    why: found.err().unwrap_or(WhyLeftOut::NoStones { reach_m }),
                });
                continue;
            }
        };
        let (mean, covariance) = of_stones(&stones, datum);
        let difference = Difference {
            place: instrument.place,
            value: [0, 1, 2].map(|axis| Some(mean[axis] - motion[axis]?.value_m)),
        };
        chosen.extend(3 * k..3 * k + 3);
        stone_errors.push(covariance);
        all.push(Beside {
            instrument,
            motion,
            stones,
            mean,
            difference,
        });
    }

    let mut covariance = readings.select_rows(&chosen).select_columns(&chosen);
    for (i, errors) in stone_errors.iter().enumerate() {
        let mut block = covariance.fixed_view_mut::<3, 3>(3 * i, 3 * i);
        block += errors;
    }
    (all, covariance)
}

/// The covariance of some differences, of that of all.
fn of_differences(covariance: &DMatrix<f64>, chosen: &[usize]) -> DMatrix<f64> {
    let rows: Vec<usize> = chosen.iter().flat_map(|i| 3 * i..3 * i + 3).collect();
    covariance.select_rows(&rows).select_columns(&rows)
}

fn why(gap: ReadingGap) -> WhyLeftOut {
    match gap {
        ReadingGap::NoDate => WhyLeftOut::NoDate,
        ReadingGap::Before => WhyLeftOut::BeforeReadings,
        ReadingGap::After => WhyLeftOut::AfterReadings,
        ReadingGap::Apart(days) => WhyLeftOut::Gap { days },
    }
}

fn file_name(file: &Path) -> String {
    file.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

/// The nearest measured stones that are not loose.
fn around<'a>(instrument: &Moved, rows: &'a [StoneRow]) -> Vec<&'a StoneRow> {
    let near = rows.iter().filter_map(|row| {
        let distance = (row.centroid - instrument.place).norm();
        let is_firm = row.motion.as_ref().is_some_and(|m| !m.loose);
        (is_firm && distance <= instrument.reach_m).then_some((distance, row))
    });
    let mut near: Vec<(f64, &StoneRow)> = near.collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    near.into_iter().take(STONES).map(|(_, row)| row).collect()
}

/// The mean motion of stones, and its covariance without the registration error: the mean of theirs, as of errors that
/// neighbours share, which that of the mean never exceeds.
fn of_stones(stones: &[&StoneRow], datum: &Datum) -> (Vector3<f64>, Matrix3<f64>) {
    let motions = || stones.iter().filter_map(|row| Some((row, row.motion.as_ref()?)));
    let count = motions().count().max(1) as f64;
    let mean = motions().map(|(_, m)| m.displacement).sum::<Vector3<f64>>() / count;
    let own = |(row, motion): (&&StoneRow, &RowMotion)| {
        let shared = datum.covariance_at(&row.centroid).unwrap_or_else(Matrix3::zeros);
        without_negative(&(motion.covariance - shared))
    };
    (mean, motions().map(own).sum::<Matrix3<f64>>() / count)
}

fn compared(beside: &[Beside], found: &Agreement) -> Vec<ComparedInstrument> {
    let count = found.instruments.iter().filter(|t| t.p.is_some()).count() as f64;
    let one = |(b, tested): (&Beside, &Tested)| {
        let middle = b.stones.iter().map(|s| s.centroid.coords).sum::<Vector3<f64>>() / b.stones.len() as f64;
        ComparedInstrument {
            name: b.instrument.name.to_owned(),
            file: file_name(b.instrument.file),
            place: b.instrument.place.coords.into(),
            motion_m: b.motion.map(|m| m.map(|m| m.value_m)),
            sd_m: b.motion.map(|m| m.map(|m| m.variance_m2.sqrt())),
            stones: b.stones.iter().map(|s| s.stone_id).collect(),
            distance_m: (middle - b.instrument.place.coords).norm(),
            stones_m: b.mean.into(),
            difference_m: tested.difference,
            difference_sd_m: tested.sd,
            p: tested.p,
            agrees: tested.p.map(|p| p * count > LEVEL),
            is_used: b.instrument.is_used,
        }
    };
    beside.iter().zip(&found.instruments).map(one).collect()
}

fn use_of(found: &Agreement) -> DatumUse {
    match found.p {
        Some(p) if p < CONTRADICTED => DatumUse::Contradicted,
        _ if found.is_determined => DatumUse::Observed,
        _ => DatumUse::Undetermined,
    }
}

/// Notes which instruments disagree, which are left out, and what becomes of those in use.
pub fn note_instruments(context: &Context, record: &InstrumentsEpoch) {
    let names = |names: Vec<&str>| Said::from(names.join(", "));
    let left_out: Vec<&str> = record.left_out.iter().map(|l| l.name.as_str()).collect();
    if !left_out.is_empty() {
        let message = INSTRUMENTS_LEFT_OUT.say(&[("names", names(left_out))]);
        context.warnings.notice(STEP, &record.epoch, message);
    }
    let apart = record.compared.iter().filter(|c| c.agrees == Some(false));
    let apart: Vec<&str> = apart.map(|c| c.name.as_str()).collect();
    if !apart.is_empty() {
        let message = INSTRUMENTS_DISAGREE.say(&[("names", names(apart))]);
        context.warnings.notice(STEP, &record.epoch, message);
    }
    match record.datum {
        Some(DatumUse::Contradicted) => {
            let message = Said::from(&INSTRUMENTS_CONTRADICTED);
            context.warnings.skipped(STEP, &record.epoch, message);
        }
        Some(DatumUse::Undetermined) => {
            let message = Said::from(&INSTRUMENTS_UNDETERMINED);
            context.warnings.skipped(STEP, &record.epoch, message);
        }
        Some(DatumUse::Observed) | None => {}
    }
}

/// Takes the error that instruments show off the motions, and replaces the covariance of the registration by what is
/// left of it.
fn update(shown: Before, error: &RegistrationError, normals: &Normals, count: usize, language: Language) {
    let before = shown.datum.clone();
    let error_mm = 1e3 * error.mean.fixed_rows::<3>(0).norm();
    let note = DATUM_INSTRUMENTS.say(&[
        ("n", count.to_string().into()),
        ("error_mm", Said::numbers(format!("{error_mm:.2}"))),
    ]);
    let mut datum = Datum {
        sources: before.sources.clone(),
        ..Datum::known(DatumState::Instruments, &error.centre, &error.covariance, note).recorded(language)
    };
    datum.taken_off = Some((shown.taken_off + error.mean).into());
    let rotation_before = before.rotation_covariance().unwrap_or_else(Matrix3::zeros);
    let rotation_after = datum.rotation_covariance().unwrap_or_else(Matrix3::zeros);

    for row in shown.rows {
        let (Some(motion), Some(normal)) = (&row.motion, normals.get(&StoneId(row.stone_id))) else {
            continue;
        };
        let shared = |datum: &Datum| datum.covariance_at(&row.centroid).unwrap_or_else(Matrix3::zeros);
        let alone = RowMotion {
            covariance: without_negative(&(motion.covariance - shared(&before))),
            rotation_covariance: without_negative(&(motion.rotation_covariance - rotation_before)),
            budget: motion.budget.clone().without(Term::Registration),
            ..motion.clone()
        };
        let reference = Reference {
            error: error.at(&row.centroid),
            turn: error.turn(),
            motion: Vector3::zeros(),
            terms: vec![(Term::Registration, shared(&datum))],
            rotation_covariance: rotation_after,
        };
        row.motion = Some(alone.against(normal, &reference));
    }

    *shown.datum = datum;
}
