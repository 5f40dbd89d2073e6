//! `compare`: clouds without stones.

use crate::args::{CompareArgs, CompareCommand};
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::{Context, Result, bail};
use std::path::Path;
use stonewise::check::require_memory_of_clouds;
use stonewise::results::names::DATA_DIR;
use stonewise::{Comparison, Error, Language, OutputFolder, Owner, Project, compare_clouds};
use stonewise_core::change::{M3c2Params, params_from_cloudcompare};

/// Compares the clouds of a project, two clouds, or a cloud and a mesh.
pub fn compare(which: &CompareCommand, force: bool, printer: &Printer) -> Result<Outcome> {
    match which {
        CompareCommand::M3c2(args) => m3c2(args, force, printer),
        CompareCommand::C2c(args) => c2c(args, force, printer),
        CompareCommand::C2m(args) => c2m(args, force, printer),
    }
}

/// M3C2 of a project or of two clouds.
fn m3c2(args: &CompareArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let params = args.params.as_deref().map(cloudcompare_params).transpose()?;
    let mut project = project(args, params.clone().unwrap_or_default())?;
    if let Some(params) = params {
        project.settings.m3c2 = params;
    }
    let what = Comparison::M3c2 {
        recipes: args.recipes,
    };
    compare_as(&project, what, args, force, printer)
}

/// C2C of a project or of two clouds.
fn c2c(args: &CompareArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let what = Comparison::C2c {
        max_m: args.max_distance,
    };
    let project = project(args, M3c2Params::default())?;
    compare_as(&project, what, args, force, printer)
}

/// C2M of a mesh and a cloud.
fn c2m(args: &CompareArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let [mesh, cloud] = args.inputs.as_slice() else {
        let message = "c2m needs a mesh and a cloud: stonewise compare c2m mesh.ply cloud.laz";
        return Err(Error::Parameters(message.to_owned()).into());
    };
    let project = Project::of_clouds(mesh, cloud, M3c2Params::default());
    let what = Comparison::C2m {
        mesh,
        max_m: args.max_distance,
    };
    compare_as(&project, what, args, force, printer)
}

fn compare_as(
    project: &Project,
    what: Comparison,
    args: &CompareArgs,
    force: bool,
    printer: &Printer,
) -> Result<Outcome> {
    if !force {
        require_memory_of_clouds(project)?;
    }
    let folder = claim(project, args, force)?;
    let below = match args.inputs.as_slice() {
        [_] => DATA_DIR,
        _ => "",
    };
    let warnings = compare_clouds(project, what, &folder, Path::new(below), printer)?;
    printer.finish();
    for doubt in warnings.iter().filter(|w| w.doubt) {
        printer.log(&format!("DOUBT: {}", doubt.line(Language::English)));
    }
    printer.log(&format!("results: {}", folder.path().display()));
    Ok(match warnings.iter().any(|w| w.doubt) {
        true => Outcome::InDoubt,
        false => Outcome::Done,
    })
}

/// Results of a project go where its other results are; those of two clouds into a folder of these clouds.
fn claim(project: &Project, args: &CompareArgs, force: bool) -> Result<OutputFolder> {
    Ok(match args.inputs.as_slice() {
        [_] => OutputFolder::of_project(&args.out, project, force)?,
        clouds => {
            let written = [
                "m3c2.laz",
                "m3c2.csv",
                "m3c2_cloudcompare.txt",
                "m3c2_cloudcompare.sh",
                "m3c2_pdal.json",
                "c2c.laz",
                "c2m.laz",
                "work",
            ];
            OutputFolder::of_inputs(
                &args.out,
                &Owner::inputs("clouds", clouds),
                clouds,
                &written,
                force,
            )?
        }
    })
}

fn project(args: &CompareArgs, params: M3c2Params) -> Result<Project> {
    match args.inputs.as_slice() {
        [project] => Ok(Project::read(project)?),
        [before, after] => Ok(Project::of_clouds(before, after, params)),
        _ => bail!("one project file or two clouds are needed"),
    }
}

fn cloudcompare_params(path: &Path) -> Result<M3c2Params> {
    let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    params_from_cloudcompare(&text).with_context(|| path.display().to_string())
}
