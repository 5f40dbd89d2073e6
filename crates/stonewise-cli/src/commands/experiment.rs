//! `test experiment`.

use crate::args::{ExperimentCommand, PaperArgs};
use crate::commands::{Outcome, part::part, simulate};
use crate::printer::Printer;
use crate::stdout::stdout;
use anyhow::{Result, bail};
use std::io::Write;
use std::path::{Path, PathBuf};
use stonewise::experiment::{PaperSurvey, paper as run_paper};
use stonewise::{OutputFolder, Owner, Project};
use stonewise_simulate::SurveyParams;

/// Runs an experiment.
pub fn experiment(which: &ExperimentCommand, force: bool, printer: &Printer) -> Result<Outcome> {
    match which {
        ExperimentCommand::Paper(args) => paper(args, force, printer),
    }
}

/// The paper's experiment; its tables go to stdout.
fn paper(args: &PaperArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    // Read first, so that a project with a mistake claims no folder.
    let given: Vec<PaperSurvey> = args.surveys.iter().map(|s| survey(s)).collect::<Result<_>>()?;
    let inputs: Vec<PathBuf> = given.iter().flat_map(|s| s.project.inputs()).collect();
    let files: Vec<PathBuf> = given.iter().map(|s| s.project.path.clone()).collect();
    let owner = Owner::inputs("experiment paper", &files);
    let folder = OutputFolder::of_inputs(&args.out, &owner, &inputs, &["work"], force)?;
    let mut surveys = if given.is_empty() {
        simulated(args, printer)?
    } else {
        given
    };
    for survey in &mut surveys {
        if let Some(text) = &args.paper_part {
            survey.paper_part = Some(part("--paper-part", text, &survey.project)?);
        }
    }
    let tables = run_paper(&surveys, args.epoch.as_deref(), args.seed, folder.path(), printer)?;
    printer.finish();
    write!(stdout(), "{}", tables.markdown())?;
    printer.log(&format!("open {}", args.out.join("index.html").display()));
    Ok(Outcome::Done)
}

/// `NAME=FILE`, or a file that gives its own name.
fn survey(text: &str) -> Result<PaperSurvey> {
    let (name, path) = match text.split_once('=') {
        Some((name, path)) if !Path::new(text).exists() => (name.to_owned(), path),
        _ => {
            let stem = Path::new(text).file_stem().unwrap_or_default();
            (stem.to_string_lossy().into_owned(), text)
        }
    };
    if name.is_empty() {
        bail!("{text:?}: write NAME=FILE or FILE");
    }
    Ok(PaperSurvey {
        name,
        project: Project::read_for_split(Path::new(path))?,
        paper_part: None,
    })
}

/// One epoch of a dam, from both scanners.
fn simulated(args: &PaperArgs, printer: &Printer) -> Result<Vec<PaperSurvey>> {
    let folder = args.out.join("survey");
    let params = SurveyParams {
        epochs: 1,
        ..SurveyParams::dam(args.size).seeded(args.seed)
    };
    // The experiment's own: another seed or size makes it anew.
    simulate::make_once(&folder, &params, true, printer)?;
    let read = |name: &str, file: &str| -> Result<PaperSurvey> {
        Ok(PaperSurvey {
            name: name.to_owned(),
            project: Project::read_for_split(&folder.join(file))?,
            paper_part: None,
        })
    };
    Ok(vec![
        read("TLS", "stonewise.toml")?,
        read("UAV", "stonewise_uav.toml")?,
    ])
}
