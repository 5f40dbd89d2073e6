//! `run --plan` and `run --unit`: a run in pieces, for other programs to spread over machines.

use crate::args::RunArgs;
use crate::commands::Outcome;
use crate::commands::run::{conclude, outcome_of, tell, tell_of_project};
use crate::counted::counted;
use crate::printer::Printer;
use crate::stdout::stdout;
use anyhow::Result;
use serde_json::Map;
use std::io::Write;
use stonewise::Error;

/// Plans the units of a project and prints them.
pub fn plan(args: &RunArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let [project] = args.inputs.as_slice() else {
        return Err(Error::Parameters("--plan needs one project file".to_owned()).into());
    };
    let coordinator = stonewise::plan(project, &Map::new(), &args.out, force, printer)?;
    printer.finish();
    let plan = &coordinator.plan;
    let text = match args.ids {
        false => serde_json::to_string_pretty(plan)?,
        true => {
            let open = plan.units.iter().filter(|u| !u.done);
            let of_rank = open.filter(|u| args.rank.is_none_or(|rank| u.rank == rank));
            of_rank.map(|u| u.id.as_str()).collect::<Vec<_>>().join("\n")
        }
    };
    let done = plan.units.iter().filter(|u| u.done).count();
    printer.log(&format!(
        "{}, {done} of them done",
        counted(plan.units.len(), "unit")
    ));
    if !text.is_empty() {
        writeln!(stdout(), "{text}")?;
    }
    Ok(Outcome::Done)
}

/// Does a unit; the last one ends as `run` does.
pub fn unit(args: &RunArgs, printer: &Printer) -> Result<Outcome> {
    let [unit] = args.inputs.as_slice() else {
        return Err(Error::Parameters("--unit needs the name of one unit".to_owned()).into());
    };
    let unit = unit.to_string_lossy();
    let done = stonewise::do_unit(&args.out, &unit, printer)?;
    printer.finish();
    if done.was_done {
        printer.log(&format!("{unit} was done"));
    }
    Ok(match &done.summary {
        Some(summary) => {
            tell_of_project(&done.project, printer);
            tell(&done.project, summary, printer);
            conclude(summary, &args.out, printer);
            outcome_of(summary)
        }
        None => Outcome::Done,
    })
}
