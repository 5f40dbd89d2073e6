//! The survey against what `run.json` says of it.

use super::compare::{Tolerance, first_difference, json};
use super::finding::{Answer, Finding};
use crate::error::Result;
use crate::project::Project;
use crate::results::records::{InputRecord, RunRecord};
use crate::storage::step::path_digest;
use std::path::Path;

const KIND: &str = "inputs";

/// Epochs, parameters, and the digests of clouds, cameras, masks, edits, conditions and instruments. Photos have no digest in
/// `run.json`: the run again shows whether they are the same.
pub(super) fn inputs(run: &RunRecord, project: &Project) -> Result<Vec<Finding>> {
    let mut findings = Vec::new();
    let fails = |subject: &str, message: String| Finding::new(KIND, subject, Answer::Fails, message);
    let names = |names: Vec<&str>| names.join(", ");
    let recorded = names(run.epochs.iter().map(|e| e.name.as_str()).collect());
    let present = names(project.epochs.iter().map(|e| e.name.as_str()).collect());

    if recorded != present {
        let message = format!("the run's epochs are {recorded}, the project's {present}");
        findings.push(fails("epochs", message));
        return Ok(findings);
    }

    let parameters = [&run.parameters, &project.settings].map(json);
    if let Some(difference) = first_difference(&parameters[0], &parameters[1], &|_| Tolerance::ROUNDING) {
        findings.push(fails(
            "parameters",
            format!("differ from those of the run: {difference}"),
        ));
    }

    let mut agree = 0;
    let mut compare = |subject: &str, record: Option<&InputRecord>, path: Option<&Path>| -> Result<()> {
        match (record, path) {
            (None, None) => {}
            (Some(record), Some(path)) if record.blake3 == path_digest(path)? => agree += 1,
            (Some(record), Some(path)) => {
                let message = format!(
                    "{} is not the {} of the run",
                    path.display(),
                    record.path.display()
                );
                findings.push(fails(subject, message));
            }
            (record, _) => {
                let message = match record {
                    Some(record) => format!("the project has none, the run had {}", record.path.display()),
                    None => "the project has one, the run had none".to_owned(),
                };
                findings.push(fails(subject, message));
            }
        }
        Ok(())
    };

    for (record, epoch) in run.epochs.iter().zip(project.epochs.iter()) {
        let subject = |what: &str| format!("{what} of {}", epoch.name);
        for i in 0..record.clouds.len().max(epoch.clouds.len()) {
            let path = epoch.clouds.get(i).map(|p| p.as_path());
            compare(&subject("cloud"), record.clouds.get(i), path)?;
        }
        let cameras = epoch.photos.as_ref().map(|p| p.cameras.as_path());
        compare(&subject("cameras"), record.cameras.as_ref(), cameras)?;
        compare(&subject("masks"), record.masks.as_ref(), epoch.masks.as_deref())?;
    }

    let edits = project.edits.as_ref().map(|e| e.path.as_path());
    compare("edits", run.edits.as_ref(), edits)?;
    let conditions = project.conditions.as_ref().map(|c| c.path.as_path());
    compare("conditions", run.conditions.as_ref(), conditions)?;

    let instruments: Vec<&Path> = project.instrument_files().collect();
    for i in 0..run.instruments.len().max(instruments.len()) {
        compare("instruments", run.instruments.get(i), instruments.get(i).copied())?;
    }

    let message = format!("{agree} inputs are those of the run");
    findings.push(Finding::new(KIND, "digests", Answer::Holds, message));
    Ok(findings)
}
