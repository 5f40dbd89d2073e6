//! `verdict.json`: the state of the wall, its zones and its stones.

use crate::error::Result;
use crate::files::write_readable_json;
use crate::pipeline::context::Context;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::outputs::tables::TABLES;
use crate::pipeline::steps::change::CHANGE;
use crate::pipeline::until::Until;
use crate::results::ResultSet;
use crate::results::names::VERDICT as FILE;
use crate::results::records::{EpochVerdict, Verdict};
use crate::verdict::{is_doubted, verdict_on};
use std::sync::Arc;
use stonewise_core::epoch::EpochId;

/// Makes the verdict on every later epoch from the tables in the folder, and writes it.
pub static VERDICT: Step = Step {
    name: "verdict",
    needs: &[Need::all(&TABLES), Need::all(&CHANGE)],
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
    let (thresholds, language) = (&project.settings.thresholds, project.settings.report.language);
    let warnings = context.warnings.sorted();
    let on_epoch = |later: EpochId| -> Result<EpochVerdict> {
        context.progress.check()?;
        let results = ResultSet::read_measured(&context.out, later.index())?;
        let epochs = project.epochs.pair(later).map(|e| e.name.clone());
        let others = project.epochs.iter().skip(1).map(|e| e.name.as_str());
        let in_doubt = is_doubted(&warnings, &epochs.later, others);
        Ok(verdict_on(
            &results,
            epochs.into_array(),
            in_doubt,
            thresholds,
            language,
        ))
    };
    let epochs = project
        .epochs
        .later_ids()
        .map(on_epoch)
        .collect::<Result<Vec<_>>>()?;
    let verdict = Verdict::new(thresholds, epochs);
    write_readable_json(&context.out.join(FILE), &verdict)?;
    Ok(verdict)
}
