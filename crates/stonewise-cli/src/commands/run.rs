//! `run`.

use crate::args::{ExitOn, RunArgs, Step};
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::{Context, Result};
use std::path::Path;
use stonewise::results::names::PairFile;
use stonewise::results::records::{EpochVerdict, State};
use stonewise::results::{Status, StoneRow};
use stonewise::{
    Language, OutputFolder, PREVIOUS_DIR, PROJECT_STEP, Project, ScansProject, Summary, Until, is_scan,
};
use stonewise_core::progress::Progress;

/// Runs a whole project; with `--exit-on` the verdict decides the exit code.
pub fn run(args: &RunArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let (project, folder) = match args.inputs.as_slice() {
        [project] if !is_scan(project) => {
            let project = Project::read(project)?;
            let folder = OutputFolder::of_project(&args.out, &project, force)?;
            (project, folder)
        }
        scans => {
            let scans = ScansProject::new(scans, &args.out)?;
            let folder = OutputFolder::of_project(&args.out, &scans.project, force)?;
            scans.write()?;
            (scans.project, folder)
        }
    };
    let until = args.until.map_or(Until::Reported, Step::until);
    let (outcome, summary) = run_to(&folder, &project, until, printer)?;
    match until {
        Until::Reported => conclude(&summary, folder.path(), printer),
        _ => say_verdict(&summary, printer),
    }
    let state = summary.verdict.as_ref().map(|v| v.state);
    Ok(match (args.exit_on, state) {
        (Some(_), Some(State::Alarm)) | (Some(ExitOn::Attention), Some(State::Attention)) => Outcome::Verdict,
        (Some(_), Some(State::CannotTell)) => Outcome::InDoubt,
        _ => outcome,
    })
}

/// Runs the project of a file up to the step `until`.
pub fn run_project(file: &Path, out: &Path, until: Until, force: bool, printer: &Printer) -> Result<Outcome> {
    let project = Project::read(file)?;
    let folder = OutputFolder::of_project(out, &project, force)?;
    let (outcome, summary) = run_to(&folder, &project, until, printer)?;
    say_verdict(&summary, printer);
    Ok(outcome)
}

/// The verdict's sentence, which is the last thing that a person reads.
fn say_verdict(summary: &Summary, printer: &Printer) {
    if let Some(verdict) = &summary.verdict {
        verdict
            .series
            .iter()
            .for_each(|series| printer.log(&series.sentence));
        printer.log(&verdict.sentence);
    }
}

/// Runs a project up to the step `until`, in a folder that is claimed already, and prints what came out; the caller
/// says the verdict, which comes last.
pub fn run_to(
    folder: &OutputFolder,
    project: &Project,
    until: Until,
    printer: &Printer,
) -> Result<(Outcome, Summary)> {
    // Said before the work, so that what is missing can still be added.
    tell_of_project(project, printer);
    let summary = measure(folder, project, until, printer)?;
    printer.finish();
    tell(project, &summary, printer);
    Ok((outcome_of(&summary), summary))
}

/// Ends a finished run: says where the results and the report are, and the verdict.
pub fn conclude(summary: &Summary, out: &Path, printer: &Printer) {
    printer.log(&format!("results: {}", out.display()));
    printer.log(&format!(
        "open {}",
        out.join(PairFile::ReportPage.place(1)).display()
    ));
    say_verdict(summary, printer);
}

/// How a finished run ended.
pub fn outcome_of(summary: &Summary) -> Outcome {
    match summary.skipped_inputs() || summary.doubts().next().is_some() {
        true => Outcome::InDoubt,
        false => Outcome::Done,
    }
}

/// Runs a project up to the step `until`; an error says where the results of the last finished run are.
///
/// # Errors
/// What stops the run; the error says where the results of the last finished run are.
pub fn measure(
    folder: &OutputFolder,
    project: &Project,
    until: Until,
    progress: &dyn Progress,
) -> Result<Summary> {
    stonewise::run(project, folder, until, progress)
        .with_context(|| unfinished(folder.path()))
        .with_context(|| format!("{} is not finished", project.name))
}

/// Where results of an earlier run are now.
fn unfinished(out: &Path) -> String {
    let previous = out.join(PREVIOUS_DIR);
    match previous.exists() {
        true => format!(
            "the results of the last finished run lie in {}",
            previous.display()
        ),
        false => format!("{} holds no finished results", out.display()),
    }
}

/// Prints the notes on how the project file was read.
pub fn tell_of_project(project: &Project, printer: &Printer) {
    let language = project.settings.report.language;
    for note in &project.notes {
        printer.remark(word("note", language), note.text(language), note.code.as_deref());
    }
}

/// A word that the command says around the results.
fn word(key: &str, language: Language) -> &'static str {
    language.text(&format!("terminal.{key}"))
}

/// Prints in a few lines what came out, without the notes on the project file. Doubts come first, also with `--quiet`.
pub fn tell(project: &Project, summary: &Summary, printer: &Printer) {
    let language = project.settings.report.language;
    for doubt in summary.doubts() {
        printer.always(&format!("{}: {}", word("doubt", language), doubt.line(language)));
    }
    for warning in summary
        .warnings
        .iter()
        .filter(|w| !w.doubt && w.step != PROJECT_STEP)
    {
        let key = if warning.skipped_input { "skipped" } else { "note" };
        printer.remark(
            word(key, language),
            &warning.text(language),
            warning.code.as_deref(),
        );
    }
    for (epoch, pair) in project.epochs.iter().skip(1).zip(&summary.pairs) {
        if pair.rows.is_empty() {
            continue;
        }
        let verdicts = summary.verdict.iter().flat_map(|v| &v.epochs);
        let verdict = verdicts.into_iter().find(|v| v.epoch == epoch.name);
        printer.log(&format!(
            "{}: {}",
            epoch.name,
            counts(&pair.rows, verdict, language)
        ));
        // The sentence on a single later epoch is the last line.
        if let Some(verdict) = verdict.filter(|_| summary.pairs.len() > 1) {
            printer.log(&format!("{}: {}", epoch.name, verdict.sentence));
        }
    }
}

fn counts(rows: &[StoneRow], verdict: Option<&EpochVerdict>, language: Language) -> String {
    let count = |is: fn(&StoneRow) -> bool| rows.iter().filter(|row| is(row)).count();
    let numbers = [
        ("stones", rows.len()),
        ("matched", count(|r| r.matched_id.is_some())),
        ("measured", count(|r| r.status == Status::Ok)),
        ("moved", verdict.map_or(0, |v| v.wall.moved)),
        ("loose", count(|r| r.motion.as_ref().is_some_and(|m| m.loose))),
    ];
    let mut said = numbers
        .map(|(key, n)| format!("{} {n}", word(key, language)))
        .to_vec();
    if verdict.is_some_and(|v| !v.is_sound()) {
        said.truncate(3);
        said.push(word("cannot_tell", language).to_owned());
    }
    said.join(", ")
}
