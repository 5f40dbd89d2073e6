//! `test simulate` and `demo`.

use crate::args::{DemoArgs, Preset, SimulateArgs};
use crate::commands::parameters::in_file;
use crate::commands::{Outcome, run};
use crate::counted::counted;
use crate::printer::Printer;
use anyhow::Result;
use std::path::Path;
use stonewise::experiment::not_simulated;
use stonewise::segmentation;
use stonewise::{OutputFolder, Owner, Project, Until, read_toml, require_memory};
use stonewise_core::progress::Progress;
use stonewise_simulate::{SurveyParams, SurveySummary, write_survey};

/// The work in messages about memory.
const THIS: &str = "this simulation";

/// Makes a small survey, runs it and scores it against its truth.
pub fn demo(args: &DemoArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let mut params = SurveyParams::demo();
    params.scene.seed = args.seed;
    params.scene.wall.seed = args.seed;
    if !force {
        require_memory(params.memory_bytes(), THIS)?;
        segmentation::require_memory()?;
    }
    let survey = args.out.join("survey");
    let path = survey.join("stonewise.toml");
    let owner = Owner::project(&path, &params.name);
    let folder = OutputFolder::of_inputs(&args.out, &owner, &[], &[], force)?;
    make_once(&survey, &params, force, printer)?;
    let project = Project::read(&path)?;
    let (outcome, summary) = run::run_to(&folder, &project, Until::Reported, printer)?;
    super::evaluate::score(&args.out, &survey.join("truth/stones.csv"), printer)?;
    folder.note_made_anew()?;
    run::conclude(&summary, &args.out, printer);
    Ok(outcome)
}

/// Makes a simulated survey, unless the folder holds the one with these parameters.
pub fn make_once(path: &Path, params: &SurveyParams, force: bool, printer: &Printer) -> Result<()> {
    let folder = claim(path, params, force)?;
    let written = std::fs::read_to_string(folder.path().join("simulation.toml")).ok();
    let is_there = folder.path().join("stonewise.toml").exists()
        && written.and_then(|t| toml::from_str::<SurveyParams>(&t).ok()) == Some(params.clone());
    if !is_there {
        write_survey(folder.path(), params, printer).map_err(not_simulated)?;
    }
    Ok(())
}

/// The folder of the survey with these parameters.
fn claim(path: &Path, params: &SurveyParams, force: bool) -> Result<OutputFolder> {
    let owner = Owner::survey(params.scene.seed, &toml::to_string(params)?);
    Ok(OutputFolder::of_inputs(path, &owner, &[], &[], force)?)
}

/// Writes the survey with these parameters into a folder; `force`: also if the folder holds other files or memory
/// is short.
///
/// # Errors
/// A parameter is impossible, the folder holds other files, memory is short, or [`write_survey`] fails.
pub fn simulate_survey(
    out: &Path,
    params: &SurveyParams,
    force: bool,
    progress: &dyn Progress,
) -> Result<SurveySummary> {
    params.check().map_err(not_simulated)?;
    if !force {
        require_memory(params.memory_bytes(), THIS)?;
    }
    let folder = claim(out, params, force)?;
    Ok(write_survey(folder.path(), params, progress).map_err(not_simulated)?)
}

/// Makes a simulated survey.
pub fn simulate(args: &SimulateArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let mut params = match &args.params {
        None if args.preset == Preset::Dam => SurveyParams::dam(args.size),
        None => SurveyParams::default(),
        Some(path) => {
            let params: SurveyParams = read_toml(path)?;
            params.check().map_err(in_file(path))?;
            params
        }
    };
    if let Some(seed) = args.seed {
        params = params.seeded(seed);
    }
    let summary = simulate_survey(&args.out, &params, force, printer)?;
    printer.log(&format!(
        "{}, {}, {}: {}",
        counted(summary.stones, "stone"),
        counted(summary.points, "point"),
        counted(summary.photos, "photo"),
        summary.project.display()
    ));
    Ok(Outcome::Done)
}
