//! `verdict.json`: the state of the wall, its zones and its stones.

use crate::error::Result;
use crate::files::write_readable_json;
use crate::pipeline::context::Context;
use crate::results::ResultSet;
use crate::results::names::VERDICT;
use crate::results::records::{EpochVerdict, Verdict};
use crate::verdict::{is_doubted, verdict_on};

/// Makes the verdict on every later epoch from the tables in the folder, and writes it.
pub fn write_verdict(context: &Context, pairs: usize) -> Result<Verdict> {
    let project = context.project;
    let (thresholds, language) = (&project.settings.thresholds, project.settings.report.language);
    let warnings = context.warnings.sorted();
    let pair = |pair: usize| -> Result<EpochVerdict> {
        context.progress.check()?;
        let results = ResultSet::read_measured(&context.out, pair)?;
        let epochs = [0, pair].map(|e| project.epochs[e].name.clone());
        let in_doubt = is_doubted(
            &warnings,
            &epochs[1],
            project.epochs.iter().skip(1).map(|e| e.name.as_str()),
        );
        Ok(verdict_on(&results, epochs, in_doubt, thresholds, language))
    };
    let epochs = (1..=pairs).map(pair).collect::<Result<Vec<_>>>()?;
    let verdict = Verdict::new(thresholds, epochs);
    write_readable_json(&context.out.join(VERDICT), &verdict)?;
    Ok(verdict)
}
