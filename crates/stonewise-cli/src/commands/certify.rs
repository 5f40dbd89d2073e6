//! `test certify`.

use crate::args::CertifyArgs;
use crate::commands::Outcome;
use crate::counted::counted;
use crate::printer::Printer;
use crate::stdout::stdout;
use anyhow::Result;
use std::io::Write;
use stonewise::experiment::{CertifyOptions, certify as make};
use stonewise::{OutputFolder, Owner, Project};

/// Makes a certificate; its figures go to stdout.
pub fn certify(args: &CertifyArgs, force: bool, printer: &Printer) -> Result<Outcome> {
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
