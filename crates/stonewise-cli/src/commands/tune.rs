//! `test tune`.

use crate::args::TuneArgs;
use crate::commands::{Outcome, part::part};
use crate::printer::Printer;
use crate::stdout::stdout;
use anyhow::{Result, bail};
use std::io::Write;
use stonewise::experiment::{TuneOptions, tune as tune_grid};
use stonewise::{OutputFolder, Owner, Project};

/// Tries a grid of parameters; the recommended lines go to stdout.
pub fn tune(args: &TuneArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let project = Project::read_for_split(&args.project)?;
    let part = match &args.part {
        Some(text) => Some(part("--part", text, &project)?),
        None => None,
    };
    let options = TuneOptions {
        grid: args.grid.clone(),
        part,
        seed: args.seed,
    };
    let owner = Owner::inputs("tune", std::slice::from_ref(&project.path));
    let folder = OutputFolder::of_inputs(&args.out, &owner, &project.inputs(), &["work", "points"], force)?;
    let tuned = tune_grid(&project, &options, folder.path(), printer)?;
    printer.finish();

    let Some(best) = tuned.recommended else {
        bail!(
            "no combination measured any stone; {} says why",
            args.out.join("tune.csv").display()
        );
    };
    let point = &tuned.points[best];

    if let Some(rmse_m) = point.rmse_m() {
        printer.log(&format!(
            "{} combinations; the recommended one measures {:.0} of {:.0} stones with an RMSE of {:.2} mm (3D)",
            tuned.points.len(),
            point.measured,
            point.stones,
            1e3 * rmse_m
        ));
    }

    printer.log(&format!("open {}", args.out.join("index.html").display()));
    write!(stdout(), "{}", tuned.lines)?;
    Ok(Outcome::Done)
}
