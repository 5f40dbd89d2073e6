//! `tune`.

use crate::args::TuneArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::{Context, Result, bail};
use std::io::Write;
use stonewise::experiment::{TuneOptions, tune as tune_grid};
use stonewise::{Part, Project};

/// Tries a grid of parameters; the recommended lines go to stdout.
pub fn tune(args: &TuneArgs, printer: &Printer) -> Result<Outcome> {
    let project = Project::read_for_split(&args.project)?;
    let part = match &args.part {
        Some(text) => Some(part(text, &project)?),
        None => None,
    };
    let options = TuneOptions {
        grid: args.grid.clone(),
        part,
        seed: args.seed,
    };
    let tuned = tune_grid(&project, &options, &args.out, printer)?;
    printer.finish();
    let Some(best) = tuned.recommended else {
        bail!(
            "no combination measured any stone; {} says why",
            args.out.join("tune.csv").display()
        );
    };
    let point = &tuned.points[best];
    if let Some(errors) = point.errors {
        printer.log(&format!(
            "{} combinations; the recommended one measures {:.0} of {:.0} stones with an RMSE of {:.2} mm (3D)",
            tuned.points.len(),
            point.measured,
            point.stones,
            1e3 * errors.rmse_m
        ));
    }
    printer.log(&format!("open {}", args.out.join("index.html").display()));
    write!(std::io::stdout(), "{}", tuned.lines)?;
    Ok(Outcome::Done)
}

/// Reads `x0,y0,z0,x1,y1,z1` or `WIDTHxHEIGHT`.
fn part(text: &str, project: &Project) -> Result<Part> {
    let numbers = |separator: char| -> Vec<f64> {
        let parsed = text
            .split(separator)
            .map(|n| n.trim().parse().unwrap_or(f64::NAN));
        parsed.collect()
    };
    let (corners, size) = (numbers(','), numbers('x'));
    match (corners.as_slice(), size.as_slice()) {
        (&[x0, y0, z0, x1, y1, z1], _) if corners.iter().all(|c| c.is_finite()) => {
            Ok(Part::between([x0, y0, z0], [x1, y1, z1]))
        }
        (_, &[width, height]) if width > 0.0 && height > 0.0 => {
            let epoch = project.epochs.first().context("the project has no epochs")?;
            Ok(Part::in_the_middle(&epoch.clouds, [width, height])?)
        }
        _ => bail!(
            "--part {text:?}: write x0,y0,z0,x1,y1,z1 (metres, world frame) or WIDTHxHEIGHT such as 5x5"
        ),
    }
}
