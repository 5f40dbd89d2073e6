//! `design`.

use crate::args::DesignArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::Result;
use std::io::Write;
use stonewise::experiment::design as predict;
use stonewise::{OutputFolder, Owner, Project};

/// Predicts what a repetition of the first survey will see; the figures go to stdout as JSON.
pub fn design(args: &DesignArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let project = Project::read_for_split(&args.project)?;
    let owner = Owner::inputs("design", std::slice::from_ref(&project.path));
    let folder = OutputFolder::of_inputs(
        &args.out,
        &owner,
        &project.inputs(),
        &["work", "baseline", "repetition"],
        force,
    )?;
    let design = predict(&project, args.seed, folder.path(), printer)?;
    printer.finish();
    writeln!(std::io::stdout(), "{}", serde_json::to_string_pretty(&design)?)?;
    printer.log(&format!("open {}", args.out.join("design.html").display()));
    Ok(Outcome::Done)
}
