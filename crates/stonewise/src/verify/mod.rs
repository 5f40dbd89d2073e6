//! Whether results are those that a run left: files against their digests, tables against each other, and,
//! with the survey at hand, inputs against their digests and the whole run again.

mod again;
mod compare;
mod files;
mod finding;
mod inputs;
mod scratch;
mod tables;

use crate::error::{Error, Result};
use crate::files::read_json;
use crate::project::Project;
use crate::results::names::{RUN, is_of_older_layout};
use crate::results::records::RunRecord;
pub use finding::{Answer, Finding, Maker, Verification};
use std::path::Path;
use stonewise_core::progress::Progress;

/// Compares results with what their run noted, and with each other; with the project of the run also its
/// inputs, and all results with those of the same run again, for which the system's folder of temporary files
/// is used. Nothing in `results` is changed.
///
/// # Errors
/// `results` has no `run.json` that can be read, a folder of temporary files cannot be used, the run cannot be
/// done again, interruption. Results that differ are findings.
pub fn verify(results: &Path, project: Option<&Project>, progress: &dyn Progress) -> Result<Verification> {
    let path = results.join(RUN);
    if is_of_older_layout(results) {
        return Err(Error::OlderResults(results.to_path_buf()));
    }
    if !path.is_file() {
        return Err(Error::NoResults(results.to_path_buf()));
    }
    let mut findings = files::files(results, progress)?;
    let run: RunRecord = match read_json(&path) {
        Ok(run) => run,
        Err(error) => {
            findings.push(Finding::new("tables", RUN, Answer::Fails, error.to_string()));
            let unknown = Maker {
                version: String::new(),
                program: String::new(),
                processor: String::new(),
            };
            return Ok(Verification::of(unknown, findings));
        }
    };
    findings.extend(tables::tables(results, &run, progress)?);
    if let Some(project) = project {
        findings.extend(inputs::inputs(&run, project)?);
        findings.extend(again::again(results, &run, project, progress)?);
    }
    Ok(Verification::of(Maker::of(&run), findings))
}
