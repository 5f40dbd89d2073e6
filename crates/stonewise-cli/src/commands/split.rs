//! `split`.

use crate::args::SplitArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::{Result, anyhow};
use stonewise::{OutputFolder, Owner, Project};

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
    let written = ["stonewise.toml", "half1", "half2"];
    let folder = OutputFolder::of_inputs(&args.out, &owner, &project.inputs(), &written, force)?;
    let path = stonewise::split(&project, epoch, args.seed, folder.path(), printer)?;
    printer.log(&format!("wrote {}", path.display()));
    Ok(Outcome::Done)
}
