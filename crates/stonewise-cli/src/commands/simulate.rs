//! `simulate` and `demo`.

use crate::args::{DemoArgs, Preset, ProjectArgs, SimulateArgs};
use crate::commands::{Outcome, run};
use crate::printer::Printer;
use anyhow::{Context, Result};
use std::path::Path;
use stonewise::Until;
use stonewise::simulate::{SurveyParams, write_survey};

/// Makes a small survey, runs it and scores it against its truth.
pub fn demo(args: &DemoArgs, printer: &Printer) -> Result<Outcome> {
    let mut params = SurveyParams::demo();
    params.scene.seed = args.seed;
    params.scene.wall.seed = args.seed;
    let folder = args.out.join("survey");
    let project = folder.join("stonewise.toml");
    make_once(&folder, &params, printer)?;
    let outcome = run::run(
        &ProjectArgs {
            project,
            out: args.out.clone(),
        },
        Until::Reported,
        printer,
    )?;
    let truth = folder.join("truth/stones.csv");
    super::evaluate::score(&args.out, &truth, printer)?;
    printer.log(&format!("open {}", args.out.join("report/index.html").display()));
    Ok(outcome)
}

/// Makes a simulated survey, unless the folder holds the one with these parameters.
pub fn make_once(folder: &Path, params: &SurveyParams, printer: &Printer) -> Result<()> {
    let written = std::fs::read_to_string(folder.join("simulation.toml")).ok();
    let is_there = folder.join("stonewise.toml").exists()
        && written.and_then(|t| toml::from_str::<SurveyParams>(&t).ok()) == Some(params.clone());
    if !is_there {
        write_survey(folder, params, printer)?;
    }
    Ok(())
}

/// Makes a simulated survey.
pub fn simulate(args: &SimulateArgs, printer: &Printer) -> Result<Outcome> {
    let mut params = match &args.params {
        None if args.preset == Preset::Dam => SurveyParams::dam(args.size),
        None => SurveyParams::default(),
        Some(path) => {
            let text =
                std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
            toml::from_str(&text).with_context(|| path.display().to_string())?
        }
    };
    if let Some(seed) = args.seed {
        params = params.seeded(seed);
    }
    let summary = write_survey(&args.out, &params, printer)?;
    printer.log(&format!(
        "{} stones, {} points, {} photos: {}",
        summary.stones,
        summary.points,
        summary.photos,
        summary.project.display()
    ));
    Ok(Outcome::Done)
}
