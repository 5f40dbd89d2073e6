//! `check`.

use crate::args::CheckArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use crate::stdout::stdout;
use crate::steps::wrapped;
use anyhow::{Result, bail};
use console::Term;
use std::io::Write;
use std::path::{Path, PathBuf};
use stonewise::check::{Depth, Verdict, check as look_at};
use stonewise::{Project, ScansProject, is_scan};

/// Ends the title of every page that this command writes.
const TITLE_END: &str = "a look at the survey</title>";

/// Looks at a survey; the table goes to stdout.
pub fn check(args: &CheckArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let project = match args.inputs.as_slice() {
        [project] if !is_scan(project) => Project::read(project)?,
        scans => ScansProject::new(scans, &args.out)?.project,
    };
    let page = page_path(args, &project, force)?;
    let report = look_at(&project, &args.out, Depth::Full, printer)?;
    printer.finish();
    // Under its column, the text of a row takes as many lines of a terminal as it needs.
    let width = Term::stdout()
        .size_checked()
        .map_or(usize::MAX, |(_, columns)| usize::from(columns));
    for (row, finding) in report.text().lines().zip(&report.findings) {
        let indent = row.find(&finding.text).map_or(0, |at| row[..at].chars().count());
        for line in wrapped(row, width, indent) {
            writeln!(stdout(), "{line}")?;
        }
    }
    match report.write_page(&page, &project) {
        Ok(()) => printer.log(&format!("pictures: {}", page.display())),
        Err(error) => printer.log(&format!(
            "note: no page with pictures ({error}); --page puts it elsewhere"
        )),
    }
    Ok(match report.verdict() {
        Verdict::Fine | Verdict::Note => Outcome::Done,
        Verdict::Doubt | Verdict::Wrong => Outcome::InDoubt,
        Verdict::Unreadable => Outcome::Failed,
    })
}

/// Path of the page: that of the option, else a file of this call's own in the temporary folder, so that nothing is
/// added to the survey. A file that is there must be an earlier page.
fn page_path(args: &CheckArgs, project: &Project, force: bool) -> Result<PathBuf> {
    let temporary = || {
        let survey = project.path.file_stem().unwrap_or_default().to_string_lossy();
        std::env::temp_dir().join(format!("{survey}-{}.check.html", std::process::id()))
    };
    let page = args.page.clone().unwrap_or_else(temporary);
    if page.exists() && !force && !is_ours(&page) {
        bail!(
            "{} is there and is no page of this command: give another --page",
            page.display()
        );
    }
    Ok(page)
}

fn is_ours(page: &Path) -> bool {
    std::fs::read_to_string(page).is_ok_and(|text| text.contains(TITLE_END))
}
