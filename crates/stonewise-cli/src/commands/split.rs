//! `split`.

use crate::args::SplitArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::{Result, anyhow};
use stonewise::Project;

/// Makes two halves of one epoch.
pub fn split(args: &SplitArgs, printer: &Printer) -> Result<Outcome> {
    let project = Project::read_for_split(&args.project)?;
    let epoch = match &args.epoch {
        None => project.epochs.first(),
        Some(name) => project.epochs.iter().find(|e| &e.name == name),
    };
    let names: Vec<&str> = project.epochs.iter().map(|e| e.name.as_str()).collect();
    let epoch = epoch.ok_or_else(|| anyhow!("no such epoch; there are: {}", names.join(", ")))?;
    let path = stonewise::split(&project, epoch, args.seed, &args.out, printer)?;
    printer.log(&format!("wrote {}", path.display()));
    Ok(Outcome::Done)
}
