//! `test certify`.

use crate::args::CertifyArgs;
use crate::commands::Outcome;
use crate::counted::counted;
use crate::printer::Printer;
use crate::stdout::stdout;
use anyhow::Result;
use std::io::Write;
use stonewise::experiment::{
    CalibratedSurvey, Calibration, CalibrationOptions, CertifyOptions, SurveyPlan, calibrate, certify as make,
};
use stonewise::{Error, OutputFolder, Owner, Project};

/// Makes a certificate, or with `--calibration` a calibration; its figures go to stdout.
pub fn certify(args: &CertifyArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    if args.calibration {
        return calibrated(args, force, printer);
    }
    let project = args.project.as_deref().map(Project::read_for_split).transpose()?;
    let files: Vec<_> = project.iter().map(|p| p.path.clone()).collect();
    let owner = Owner::inputs("certificate", &files);
    let inputs = project.as_ref().map(Project::inputs).unwrap_or_default();
    let folder = OutputFolder::of_inputs(&args.out, &owner, &inputs, &["work", "walls", "own"], force)?;
    let options = CertifyOptions {
        seed: args.seed,
        walls: args.walls,
        project,
    };
    let certificate = make(&options, folder.path(), printer)?;
    printer.finish();
    let mut out = stdout();
    for figure in &certificate.figures {
        let answer = if figure.holds { "holds" } else { "FAILS" };
        let value = figure.value.map_or("-".to_owned(), |v| format!("{v:.4}"));
        let note = match figure.note.as_str() {
            "" => String::new(),
            note => format!(" ({note})"),
        };
        writeln!(out, "{answer} {value:>10}  {}{note}", figure.name)?;
    }
    printer.log(&format!("open {}", args.out.join("certificate.html").display()));
    let outside = certificate.figures.iter().filter(|f| !f.holds).count();
    if !certificate.holds {
        printer.log(&format!("{} outside what is allowed", counted(outside, "figure")));
    }
    Ok(match certificate.holds {
        true => Outcome::Done,
        false => Outcome::InDoubt,
    })
}

fn calibrated(args: &CertifyArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let names = match args.sensor.is_empty() {
        true => CalibratedSurvey::NAMES.map(str::to_owned).to_vec(),
        false => args.sensor.clone(),
    };
    let surveys = match &args.project {
        Some(plan) if SurveyPlan::is_in(plan) => vec![CalibratedSurvey::planned(&SurveyPlan::read(plan)?)],
        Some(file) => {
            let needed =
                "--calibration takes the plan of a survey, with a table [wall], as `stonewise design` does";
            return Err(Error::Parameters(format!("{}: {needed}", file.display())).into());
        }
        None => {
            let usual = names.iter().map(|name| CalibratedSurvey::usual(name));
            usual.collect::<stonewise::Result<_>>()?
        }
    };
    let inputs: Vec<_> = args.project.iter().cloned().collect();
    let owner = Owner::inputs("certificate", &inputs);
    let folder = OutputFolder::of_inputs(&args.out, &owner, &inputs, &["work"], force)?;
    let options = CalibrationOptions {
        seed: args.seed,
        walls: args.walls,
        surveys,
    };
    let calibration = calibrate(&options, folder.path(), printer)?;
    printer.finish();
    let mut rows = vec![Calibration::HEAD.map(str::to_owned)];
    rows.extend(calibration.cells());
    let width = |k: usize| rows.iter().map(|row| row[k].len()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..Calibration::HEAD.len()).map(width).collect();
    let mut out = stdout();
    for row in &rows {
        let cells = row
            .iter()
            .zip(&widths)
            .map(|(cell, width)| format!("{cell:<width$}"));
        writeln!(out, "{}", cells.collect::<Vec<_>>().join("  ").trim_end())?;
    }
    printer.log(&format!("open {}", args.out.join("calibration.html").display()));
    let failed = calibration.rows.iter().filter(|row| !row.holds).count();
    if failed > 0 {
        let too_many = "too many truths outside their 95 % intervals";
        printer.log(&format!("{} with {too_many}", counted(failed, "row")));
        return Ok(Outcome::InDoubt);
    }
    Ok(Outcome::Done)
}
