//! `verdict.json`: the state of the wall, its zones and its stones.

use crate::error::Result;
use crate::files::{read_json, write_readable_json};
use crate::pipeline::context::Context;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::outputs::tables::TABLES;
use crate::pipeline::outputs::trends::TRENDS;
use crate::pipeline::steps::change::CHANGE;
use crate::pipeline::until::Until;
use crate::results::ResultSet;
use crate::results::names::{TRENDS as TRENDS_FILE, VERDICT as FILE};
use crate::results::records::{EpochVerdict, TrendsRecord, Verdict};
use crate::settings::Settings;
use crate::verdict::{is_doubted, series_verdict, verdict_on};
use crate::warnings::Warning;
use std::path::Path;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::progress::Progress;

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
    let project = context.project;
    let names: Vec<&str> = project.epochs.iter().map(|e| e.name.as_str()).collect();
    let warnings = context.warnings.sorted();
    let verdict = verdict_of_tables(
        &context.out,
        &names,
        &warnings,
        &project.settings,
        context.progress,
    )?;
    write_readable_json(&context.out.join(FILE), &verdict)?;
    Ok(verdict)
}

/// The verdict that the tables in a folder give. `epochs`: the names of all, the reference first; `warnings`:
/// those of the run.
pub(crate) fn verdict_of_tables(
    folder: &Path,
    epochs: &[&str],
    warnings: &[Warning],
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Verdict> {
    let (thresholds, language) = (&settings.thresholds, settings.report.language);
    let (reference, later) = match epochs {
        [] => ("", &[] as &[&str]),
        [first, later @ ..] => (*first, later),
    };
    let on_epoch = |(pair, epoch): (usize, &&str)| -> Result<EpochVerdict> {
        progress.check()?;
        let results = ResultSet::read_measured(folder, pair)?;
        let in_doubt = is_doubted(warnings, epoch, later.iter().copied());
        let names = [reference, *epoch].map(str::to_owned);
        Ok(verdict_on(&results, names, in_doubt, thresholds, language))
    };
    let epochs = (1..).zip(later).map(on_epoch).collect::<Result<Vec<_>>>()?;
    let trends: Option<TrendsRecord> = match later.len() > 1 {
        true => Some(read_json(&folder.join(TRENDS_FILE))?),
        false => None,
    };
    let series = trends.map(|found| series_verdict(&found, language));
    Ok(Verdict::new(thresholds, epochs).with_series(series))
}
