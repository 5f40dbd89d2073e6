//! `test split`.

use crate::args::SplitArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::{Result, anyhow};
use stonewise::{OutputFolder, Owner, Project, SPLIT_FILES};

/// Makes two halves of one epoch.
pub fn split(args: &SplitArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let project = Project::read_for_split(&args.project)?;
    let epoch = match &args.epoch {
        None => project.epochs.first(),
        Some(name) => project.epochs.iter().find(|e| &e.name == name),
    };
    let names: Vec<&str> = project.epochs.iter().map(|e| e.name.as_str()).collect();
    let epoch = epoch.ok_or_else(|| anyhow!("no such epoch; there are: {}", names.join(", ")))?;
    let kind = format!("halves of epoch {:?}, seed {}", epoch.name, args.seed);
    let owner = Owner::inputs(&kind, std::slice::from_ref(&project.path));
    let folder = OutputFolder::of_inputs(&args.out, &owner, &project.inputs(), &SPLIT_FILES, force)?;
    let halves = stonewise::split(&project, epoch, args.seed, folder.path(), printer)?;
    printer.log(&format!("wrote {}", halves.project.display()));
    for edit in &halves.left_out {
        printer.log(&format!("left out: {edit}"));
    }
    Ok(if halves.left_out.is_empty() {
        Outcome::Done
    } else {
        Outcome::InDoubt
    })
}
