//! The whole run again, and its results against those that are to be verified.

use super::compare::{Tolerance, first_cell, first_difference};
use super::finding::{Answer, Finding, Maker};
use super::scratch::scratch;
use super::tables::copy;
use crate::error::{Error, Result};
use crate::export::write_layers;
use crate::files::read_json;
use crate::output::{Digests, OutputFolder, named_results_in, results_in};
use crate::pipeline::{Until, run as run_project};
use crate::project::Project;
use crate::report::write_report;
use crate::results::names::{DIGESTS, EVALUATION_TRUTH, PairFile, RUN};
use crate::results::records::RunRecord;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_core::progress::Progress;
use stonewise_io::table::{read_parquet, write_csv};

const KIND: &str = "again";
/// Keys of `run.json` that differ between two runs of the same: who ran it, when, where the files lie.
const OF_THE_RUN: [&str; 10] = [
    "version",
    "program",
    "processor",
    "finished_at",
    "steps",
    "file",
    "path",
    "images",
    "logo",
    "subject",
];

/// Runs the project into a temporary folder and compares every file: bytes where program and processor are those
/// of the results, else the values of tables and records within [`Tolerance::MACHINES`].
pub(super) fn again(
    results: &Path,
    run: &RunRecord,
    project: &Project,
    progress: &dyn Progress,
) -> Result<Vec<Finding>> {
    let scratch = scratch()?;
    let folder = OutputFolder::of_project(scratch.path(), project, false)?;
    let until = match results.join(PairFile::ReportPage.place(1)).exists() {
        true => Until::Reported,
        false => Until::Registered,
    };
    run_project(project, &folder, until, progress)?;
    let other_maker = Maker::of(run).differs(&Maker::present());
    let mut findings = vec![records(results, scratch.path(), other_maker.is_some())?];
    if until == Until::Reported {
        // The report shows times of the run and the layers its dates: both are made for the run to be verified.
        copy(&results.join(RUN), &scratch.path().join(RUN))?;
        write_report(scratch.path())?;
        write_layers(scratch.path())?;
    }
    let files = files_of_both(results, scratch.path(), project)?;
    let (mut same, mut within, mut not_by_value) = (0, 0, 0);
    for file in &files {
        progress.check()?;
        let [old, new] = [results, scratch.path()].map(|folder| folder.join(file));
        let answer = match (old.is_file(), new.is_file()) {
            (false, _) => Some("is missing; the run again made it".to_owned()),
            (_, false) => Some("was not made by the run again".to_owned()),
            _ if bytes(&old)? == bytes(&new)? => {
                same += 1;
                None
            }
            _ if other_maker.is_none() => Some("has other bytes than the run again gave".to_owned()),
            _ => match values(&old, &new, scratch.path())? {
                ByValue::Within => {
                    within += 1;
                    None
                }
                ByValue::Unknown => {
                    not_by_value += 1;
                    None
                }
                ByValue::Differs(difference) => Some(format!("differs from the run again: {difference}")),
            },
        };
        findings.extend(answer.map(|message| Finding::of(file, KIND, Answer::Fails, message)));
    }
    let message = match &other_maker {
        None => format!("{same} files have the same bytes"),
        Some(why) => format!(
            "made by {why}: {same} files have the same bytes, {within} the same values within the tolerance, \
             {not_by_value} are pictures, clouds and layers, which are compared by their bytes alone"
        ),
    };
    findings.push(Finding::new(KIND, "results", Answer::Holds, message));
    Ok(findings)
}

/// `run.json` without what differs between two runs of the same.
fn records(old: &Path, new: &Path, other_maker: bool) -> Result<Finding> {
    let read = |folder: &Path| -> Result<Value> {
        let mut value = read_json(&folder.join(RUN))?;
        strip(&mut value);
        Ok(value)
    };
    let tolerance = |name: &str| match other_maker {
        true => Tolerance::of_machines(name),
        false => Tolerance::ROUNDING,
    };
    Ok(match first_difference(&read(old)?, &read(new)?, &tolerance) {
        None => Finding::new(KIND, RUN, Answer::Holds, "says the same of the run again"),
        Some(difference) => {
            let message = format!("differs from that of the run again: {difference}");
            Finding::new(KIND, RUN, Answer::Fails, message)
        }
    })
}

fn strip(value: &mut Value) {
    match value {
        Value::Object(map) => {
            map.retain(|key, _| !OF_THE_RUN.contains(&key.as_str()));
            map.values_mut().for_each(strip);
        }
        Value::Array(all) => all.iter_mut().for_each(strip),
        _ => {}
    }
}

/// All files of either folder that a run makes.
fn files_of_both(old: &Path, new: &Path, project: &Project) -> Result<Vec<PathBuf>> {
    let mut files: Vec<PathBuf> = Vec::new();
    files.extend(named_results_in(old)?);
    files.extend(results_in(new, project)?);
    for folder in [old, new] {
        let digests = Digests::read(folder).ok().flatten().unwrap_or_default();
        files.extend(digests.iter().map(|(file, _)| file.to_path_buf()));
    }
    let not_of_a_run = [RUN, DIGESTS, EVALUATION_TRUTH].map(Path::new);
    files.retain(|file| !not_of_a_run.contains(&file.as_path()));
    files.sort();
    files.dedup();
    Ok(files)
}

/// What the values of two files that differ say.
enum ByValue {
    /// They agree within the tolerance.
    Within,
    /// They do not.
    Differs(String),
    /// The file is no table and no record.
    Unknown,
}

fn values(old: &Path, new: &Path, scratch: &Path) -> Result<ByValue> {
    let tolerance = |name: &str| Tolerance::of_machines(name);
    let by_cells = |texts: [String; 2]| first_cell(&texts[0], &texts[1], &tolerance);
    let extension = old.extension().unwrap_or_default().to_string_lossy().into_owned();
    let difference = match extension.as_str() {
        "csv" => by_cells([text(&bytes(old)?), text(&bytes(new)?)]),
        "parquet" => {
            let as_text = |path: &Path, name: &str| -> Result<String> {
                let csv = scratch.join(name);
                write_csv(&csv, &read_parquet(path)?, "", None)?;
                Ok(text(&bytes(&csv)?))
            };
            by_cells([as_text(old, "old.csv")?, as_text(new, "new.csv")?])
        }
        "json" => {
            let [old, new]: [Value; 2] = [read_json(old)?, read_json(new)?];
            first_difference(&old, &new, &tolerance)
        }
        _ => return Ok(ByValue::Unknown),
    };
    Ok(difference.map_or(ByValue::Within, ByValue::Differs))
}

fn bytes(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).map_err(Error::io("reading", path))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
