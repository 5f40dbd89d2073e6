//! `verdict.json`: the state of the wall, its zones and its stones.

use crate::error::Result;
use crate::files::{read_json, write_readable_json};
use crate::pipeline::context::Context;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::outputs::tables::TABLES;
use crate::pipeline::outputs::trends::TRENDS;
use crate::pipeline::steps::change::CHANGE;
use crate::pipeline::until::Until;
use crate::results::names::{TRENDS as TRENDS_FILE, VERDICT as FILE};
use crate::results::records::{EpochVerdict, TrendsRecord, Verdict};
use crate::results::{ResultSet, StoneRow, read_courses};
use crate::settings::Settings;
use crate::verdict::{Course, Pair, is_doubted, series_verdict, verdict_on};
use crate::warnings::Warning;
use std::path::Path;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::progress::Progress;

/// What changes the stones of a pair, given its number, before they are judged.
type Change<'a> = dyn Fn(usize, &mut [StoneRow]) + 'a;

/// Makes the verdict on every later epoch from the tables in the folder, and writes it.
pub static VERDICT: Step = Step {
    name: "verdict",
    needs: &[Need::all(&TABLES), Need::all(&CHANGE), Need::same(&TRENDS)],
    wanted: |until| until >= Until::Registered,
    make: |run, _| run.verdict().map(drop),
    ..Step::PLAIN
};

impl Run<'_> {
    /// The verdict on all later epochs, which is written.
    pub fn verdict(&self) -> Result<Arc<Verdict>> {
        let context = self.context;
        self.once(&VERDICT, EpochId::REFERENCE, || {
            context.timed("verdict", || write_verdict(context))
        })
    }
}

fn write_verdict(context: &Context) -> Result<Verdict> {
    let verdict = verdict_of_project(context, &|_, _| ())?;
    write_readable_json(&context.out.join(FILE), &verdict)?;
    Ok(verdict)
}

/// The verdict on the tables of a run, with the stones of each pair changed.
pub(super) fn verdict_of_project(context: &Context, change: &Change) -> Result<Verdict> {
    let project = context.project;
    let epochs: Vec<(&str, Option<&str>)> = project
        .epochs
        .iter()
        .map(|e| (e.name.as_str(), e.date.as_deref()))
        .collect();
    let warnings = context.warnings.sorted();
    let (out, settings) = (&context.out, &project.settings);
    verdict_of_tables(out, &epochs, &warnings, settings, (context.progress, change))
}

/// The verdict that the tables in a folder give. `epochs`: names and dates of all, the reference first;
/// `warnings`: those of the run; `change`: what to do before to the stones of each pair.
pub(crate) fn verdict_of_tables(
    folder: &Path,
    epochs: &[(&str, Option<&str>)],
    warnings: &[Warning],
    settings: &Settings,
    (progress, change): (&dyn Progress, &Change),
) -> Result<Verdict> {
    let (thresholds, language) = (&settings.thresholds, settings.report.language);
    let trends: Option<TrendsRecord> = match epochs.len() > 2 {
        true => Some(read_json(&folder.join(TRENDS_FILE))?),
        false => None,
    };
    let course = Course {
        epochs,
        trends: trends.as_ref(),
        stones: &read_courses(folder)?,
    };
    let reference = epochs.first().map_or("", |(name, _)| *name);
    let on_epoch = |(number, epoch): (usize, &str)| -> Result<EpochVerdict> {
        progress.check()?;
        let mut results = ResultSet::read_measured(folder, number)?;
        change(number, &mut results.stones);
        let pair = Pair {
            epochs: [reference, epoch],
            in_doubt: is_doubted(warnings, epoch, course.later()),
            course: &course,
        };
        Ok(verdict_on(&results, &pair, thresholds, language))
    };
    let epochs = (1..)
        .zip(course.later())
        .map(on_epoch)
        .collect::<Result<Vec<_>>>()?;
    let series = trends.as_ref().map(|found| series_verdict(found, language));
    Ok(Verdict::new(thresholds, epochs).with_series(series))
}
