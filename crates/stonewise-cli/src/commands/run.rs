//! `run`, and the steps of it.

use crate::args::ProjectArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::{Context, Result};
use stonewise::report::{Status, StoneRow};
use stonewise::{Project, Summary, Until};

/// Runs a project as far as asked.
pub fn run(args: &ProjectArgs, until: Until, printer: &Printer) -> Result<Outcome> {
    let project = Project::read(&args.project)?;
    let summary = stonewise::run(&project, &args.out, until, printer)
        .with_context(|| format!("{} is not finished", project.name))?;
    printer.finish();
    tell(&project, &summary, printer);
    if until == Until::Reported {
        printer.log(&format!("results: {}", args.out.display()));
    }
    Ok(if summary.skipped_inputs() {
        Outcome::SkippedInputs
    } else {
        Outcome::Done
    })
}

/// Says in a few lines what came out.
pub fn tell(project: &Project, summary: &Summary, printer: &Printer) {
    for warning in &summary.warnings {
        let word = if warning.skipped_input { "skipped" } else { "note" };
        printer.log(&format!("{word}: {}: {}", warning.subject, warning.message));
    }
    for (epoch, pair) in project.epochs.iter().skip(1).zip(&summary.pairs) {
        if !pair.rows.is_empty() {
            printer.log(&format!(
                "{} against {}: {}",
                epoch.name,
                project.epochs[0].name,
                counts(&pair.rows)
            ));
        }
    }
}

fn counts(rows: &[StoneRow]) -> String {
    let matched = rows.iter().filter(|r| r.matched_id.is_some()).count();
    let measured = rows.iter().filter(|r| r.status == Status::Ok).count();
    let motions = || rows.iter().filter_map(|r| r.motion.as_ref());
    let moved = motions().filter(|m| m.significant).count();
    let loose = motions().filter(|m| m.loose).count();
    format!(
        "{} stones, {matched} matched, {measured} measured, {moved} moved significantly, {loose} loose",
        rows.len()
    )
}
