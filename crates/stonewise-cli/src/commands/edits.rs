//! `edits`.

use crate::args::{EditsCheckArgs, EditsCommand, EditsImportArgs};
use crate::commands::Outcome;
use crate::counted::counted;
use crate::printer::Printer;
use crate::stdout::stdout;
use anyhow::{Result, bail};
use std::io::Write;
use stonewise::edits::{EditsFile, Signed, import};
use stonewise::results::records::Timestamp;

/// Reads edits from other programs, or checks a file of them.
pub fn edits(command: &EditsCommand, printer: &Printer) -> Result<Outcome> {
    match command {
        EditsCommand::Import(args) => read_edits(args, printer),
        EditsCommand::Check(args) => check(args),
    }
}

fn read_edits(args: &EditsImportArgs, printer: &Printer) -> Result<Outcome> {
    let earlier = match (args.out.exists(), args.append) {
        (true, false) => bail!(
            "{} is there: --append puts the new edits after its own",
            args.out.display()
        ),
        (true, true) => EditsFile::read(&args.out)?,
        (false, _) => EditsFile::empty(&args.out),
    };
    let today = || Timestamp::now().to_string().chars().take(10).collect();
    let signed = Signed {
        who: args.who.clone(),
        when: args.when.clone().unwrap_or_else(today),
        why: args.why.clone(),
    };

    let results = args.results.as_deref();
    let imported = import(&args.source, results, args.epoch.as_deref(), &signed, earlier)?;
    for note in &imported.notes {
        printer.log(&format!("note: {note}"));
    }

    if imported.new == 0 {
        printer.log("nothing was edited; no file is written");
        return Ok(Outcome::Done);
    }

    imported.file.write()?;
    let first = imported.file.edits.len() - imported.new;
    for edit in &imported.file.edits[first..] {
        printer.log(&format!("{} {}", edit.action.word(), shape(edit.shape())));
    }
    printer.log(&format!(
        "{} written to {}",
        counted(imported.new, "edit"),
        args.out.display()
    ));
    Ok(Outcome::Done)
}

/// The table goes to stdout.
fn check(args: &EditsCheckArgs) -> Result<Outcome> {
    let file = EditsFile::read(&args.file)?;
    let mut out = stdout();
    writeln!(out, "edit\tline\tdo\tdrawn in\tshape\twho\twhen\twhy")?;
    for (index, edit) in file.edits.iter().enumerate() {
        writeln!(
            out,
            "{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}",
            index + 1,
            file.lines.get(index).copied().unwrap_or(0),
            edit.action.word(),
            edit.photo.as_deref().unwrap_or("facade"),
            shape(edit.shape()),
            edit.who,
            edit.when,
            edit.why.replace(['\n', '\t'], " ")
        )?;
    }
    Ok(Outcome::Done)
}

/// Number of vertices and the first of them.
fn shape(vertices: &[[f64; 2]]) -> String {
    let first = vertices.first().copied().unwrap_or_default();
    format!("{} at ({:.2}, {:.2})", vertices.len(), first[0], first[1])
}
