//! `detector adapt`.

use crate::args::AdaptArgs;
use crate::commands::Outcome;
use crate::counted::counted;
use crate::printer::Printer;
use crate::stdout::stdout;
use anyhow::Result;
use std::io::Write;
use std::path::Path;
use stonewise::{OutputFolder, Owner, Project};

/// Default folder of the detector, beside the project file.
const FOLDER: &str = "adapted";

/// Trains a detector on what the survey confirms; the line for the project file goes to stdout.
pub fn adapt(args: &AdaptArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let project = Project::read_for_split(&args.project)?;
    let beside = || project.path.parent().unwrap_or(Path::new("")).join(FOLDER);
    let out = args.out.clone().unwrap_or_else(beside);
    let owner = Owner::inputs("adapt", std::slice::from_ref(&project.path));
    let folder = OutputFolder::of_inputs(&out, &owner, &project.inputs(), &["work", "training"], force)?;
    let adapted = stonewise::adapt(&project, args.minutes, &folder, printer)?;
    printer.finish();
    printer.log(&format!(
        "{} confirmed in {}, {} kept for measuring; {} taught, {} of them of stones that the detector had missed",
        counted(adapted.stones as u64, "stone"),
        counted(adapted.photos as u64, "photo"),
        adapted.kept,
        counted(adapted.masks as u64, "mask"),
        adapted.missed
    ));

    let f1 = |score: Option<f64>| score.map_or("unknown".to_owned(), |f1| format!("{f1:.3}"));
    let interval = adapted.gain_interval.map_or_else(
        || "interval unknown".to_owned(),
        |[low, high]| format!("95 % interval {low:.3} to {high:.3}"),
    );
    printer.log(&format!(
        "F1 in the parts of the wall kept apart: {} before, {} after {} ({:.1} minutes); gain {:.3}, {interval}",
        f1(adapted.before.f1),
        f1(adapted.after.f1),
        counted(adapted.steps, "step"),
        adapted.minutes,
        adapted.gain
    ));

    match &adapted.model {
        Some(model) => {
            printer.log(&format!(
                "the trained detector is better; put this into {}:",
                project.path.display()
            ));
            writeln!(stdout(), "[segment]\nmodel = {:?}", model.to_string_lossy())?;
        }
        None => printer.log("no gain is shown: the detector stays as it is"),
    }

    Ok(Outcome::Done)
}
