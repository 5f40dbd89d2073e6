//! `design`.

use crate::args::DesignArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use crate::stdout::stdout;
use anyhow::Result;
use serde::Serialize;
use std::io::Write;
use stonewise::experiment::{SurveyPlan, design as predict, design_plan};
use stonewise::{OutputFolder, Owner, Project};

/// Predicts what a repetition of the first survey will see, or what a planned survey will; the figures go to stdout as
/// JSON.
pub fn design(args: &DesignArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    if SurveyPlan::is_in(&args.project) {
        let plan = SurveyPlan::read(&args.project)?;
        let inputs = std::slice::from_ref(&args.project);
        let mut made = vec!["work".to_owned(), "as_planned".to_owned()];
        made.extend(plan.candidates().iter().map(|name| format!("with_{name}")));
        let made: Vec<&str> = made.iter().map(String::as_str).collect();
        let owner = Owner::inputs("design", inputs);
        let folder = OutputFolder::of_inputs(&args.out, &owner, inputs, &made, force)?;
        let designed = design_plan(&plan, args.seed, folder.path(), printer)?;
        return show(args, &designed, printer);
    }
    let project = Project::read_for_split(&args.project)?;
    let owner = Owner::inputs("design", std::slice::from_ref(&project.path));
    let folder = OutputFolder::of_inputs(
        &args.out,
        &owner,
        &project.inputs(),
        &["work", "baseline", "repetition"],
        force,
    )?;
    let designed = predict(&project, args.seed, folder.path(), printer)?;
    show(args, &designed, printer)
}

fn show(args: &DesignArgs, designed: &impl Serialize, printer: &Printer) -> Result<Outcome> {
    printer.finish();
    writeln!(stdout(), "{}", serde_json::to_string_pretty(designed)?)?;
    printer.log(&format!("open {}", args.out.join("design.html").display()));
    Ok(Outcome::Done)
}
