//! Result files against each other: what follows from tables is made from them again.

use super::compare::{Tolerance, first_cell, first_difference, json};
use super::finding::{Answer, Finding, Maker};
use super::scratch::scratch;
use crate::error::{Error, Result};
use crate::export::write_layers;
use crate::files::read_json;
use crate::output::named_results_in;
use crate::pipeline::verdict_of_tables;
use crate::report::write_report;
use crate::results::names::{
    DISPLACEMENTS_VTP, DRAWING, FACES_PLY, FACES_VTP, GEOPACKAGE, GEOPARQUET, PairFile, RUN, SERIES, VERDICT,
    is_of_report,
};
use crate::results::records::{EpochRecord, RunRecord};
use crate::results::{ResultSet, write_stones_csv};
use crate::truth::outcomes;
use nalgebra::{Point3, Vector3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_core::evaluate::score_stones;
use stonewise_core::progress::Progress;
use stonewise_io::table::{Table, read_parquet};

const KIND: &str = "tables";

/// A comparison within the results: nothing to say, or what differs.
type Compared = Result<Option<Finding>>;

/// Text and Parquet of the stones, the series, the verdict, the evaluation, the report and the layers.
pub(super) fn tables(results: &Path, run: &RunRecord, progress: &dyn Progress) -> Result<Vec<Finding>> {
    let pairs = 1..run.epochs.len().max(1);
    let mut findings = Vec::new();
    for pair in pairs.clone() {
        progress.check()?;
        findings.extend(told(&PairFile::StonesCsv.place(pair), text_of(results, pair)));
        findings.extend(told(
            &PairFile::Evaluation.place(pair),
            evaluation(results, run, pair),
        ));
    }
    findings.extend(told(SERIES, series(results, run)));
    findings.extend(told(VERDICT, verdict(results, run, progress)));
    progress.check()?;
    match made_again(results, run) {
        Ok(again) => findings.extend(again),
        Err(Error::Interrupted) => return Err(Error::Interrupted),
        Err(error) => {
            let report = PairFile::ReportPage.place(1);
            findings.push(Finding::new(KIND, &report, Answer::Fails, error.to_string()));
        }
    }
    Ok(findings)
}

/// An error of reading is a finding about the file, too.
fn told(subject: &str, compared: Compared) -> Option<Finding> {
    compared.unwrap_or_else(|error| Some(Finding::new(KIND, subject, Answer::Fails, error.to_string())))
}

fn holds(subject: &str, message: &str) -> Option<Finding> {
    Some(Finding::new(KIND, subject, Answer::Holds, message))
}

fn fails(subject: &str, message: String) -> Option<Finding> {
    Some(Finding::new(KIND, subject, Answer::Fails, message))
}

/// `stones.csv` is the text of `stones.parquet`.
fn text_of(results: &Path, pair: usize) -> Compared {
    let [csv, parquet] = [PairFile::StonesCsv, PairFile::StonesParquet].map(|file| file.place(pair));
    let scratch = scratch()?;
    write_stones_csv(scratch.path(), pair, &read_parquet(&results.join(&parquet))?)?;
    let [found, made] = [results, scratch.path()].map(|folder| text(&folder.join(&csv)));
    let (found, made) = (found?, made?);
    Ok(match first_cell(&found, &made, &|_| Tolerance::ROUNDING) {
        None => holds(&csv, &format!("has the values of {parquet}")),
        Some(difference) => fails(&csv, format!("differs from {parquet}: {difference}")),
    })
}

/// `series.parquet` has the motions of the tables of all epochs.
fn series(results: &Path, run: &RunRecord) -> Compared {
    let path = results.join(SERIES);
    if !path.exists() {
        return Ok(None);
    }
    let series = read_parquet(&path)?;
    let (epochs, stones) = (series.required::<String>("epoch")?, stone_ids(&series)?);
    // A stone that the reference does not show is measured against another epoch.
    let since = match series.names().any(|n| n == "since") {
        true => Some(series.optional::<String>("since")?),
        false => None,
    };
    let reference = run.epochs.first().map(|e| e.name.as_str());
    let is_against_reference = |row: usize| since.as_ref().is_none_or(|s| s[row].as_deref() == reference);
    for (pair, epoch) in run.epochs.iter().enumerate().skip(1) {
        let name = PairFile::StonesParquet.place(pair);
        let table = read_parquet(&results.join(&name))?;
        let rows = (0..stones.len()).filter(|&row| epochs[row] == epoch.name && is_against_reference(row));
        let row_of: BTreeMap<u32, usize> = rows.map(|row| (stones[row], row)).collect();
        for column in ["dx", "dy", "dz", "cov_xx", "cov_yy", "cov_zz"] {
            let (own, listed) = (table.optional::<f64>(column)?, series.optional::<f64>(column)?);
            for (stone, own) in stone_ids(&table)?.iter().zip(own) {
                let listed = row_of.get(stone).and_then(|&row| listed[row]);
                if listed != own {
                    return Ok(fails(
                        SERIES,
                        format!("differs from {name}: {column} of stone {stone}"),
                    ));
                }
            }
        }
    }
    Ok(holds(SERIES, "has the motions of the tables of all epochs"))
}

fn stone_ids(table: &Table) -> Result<Vec<u32>> {
    Ok(table.required::<u32>("stone_id")?.to_vec())
}

/// `verdict.json` and the verdict in `run.json` are what the tables give.
fn verdict(results: &Path, run: &RunRecord, progress: &dyn Progress) -> Compared {
    let epochs: Vec<(&str, Option<&str>)> = run
        .epochs
        .iter()
        .map(|e| (e.name.as_str(), e.date.as_deref()))
        .collect();
    let verdict = verdict_of_tables(
        results,
        &epochs,
        &run.warnings,
        &run.parameters,
        (progress, &|_, _| ()),
    )?;
    let found: Value = read_json(&results.join(VERDICT))?;
    let headlines = [json(&run.verdict), json(&Some(verdict.headlines()))];
    if let Some(difference) = first_difference(&headlines[0], &headlines[1], &|_| Tolerance::ROUNDING) {
        return Ok(fails(
            RUN,
            format!("its verdict is not that of the tables: {difference}"),
        ));
    }
    Ok(
        match first_difference(&found, &json(&verdict), &|_| Tolerance::ROUNDING) {
            None => holds(VERDICT, "states and counts are those of the tables"),
            Some(difference) => fails(VERDICT, format!("is not that of the tables: {difference}")),
        },
    )
}

/// Scores of the stones in `evaluation.json` are those of the table. Normals of faces are rounded in
/// `outlines.json`, so that errors in the face and out of it agree to a micrometre.
fn evaluation(results: &Path, run: &RunRecord, pair: usize) -> Compared {
    let name = PairFile::Evaluation.place(pair);
    if !results.join(&name).exists() {
        return Ok(None);
    }
    let [Some(first), Some(later)] = [run.epochs.first(), run.epochs.get(pair)] else {
        return Ok(None);
    };
    let found: Value = read_json(&results.join(&name))?;
    let outcomes = outcomes(&ResultSet::read_measured(results, pair)?);
    let at = |epoch: &EpochRecord, p: &Point3<f64>| {
        epoch
            .motion
            .as_ref()
            .map_or_else(Vector3::zeros, |motion| motion.displacement_at(p))
    };
    let truth = |p: &Point3<f64>| at(later, p) - at(first, p);
    let score = score_stones(&outcomes, truth, &run.parameters.evaluate);
    let tolerance = |_: &str| Tolerance::NORMALS;
    Ok(
        match first_difference(&found["stones"], &json(&score), &tolerance) {
            None => holds(&name, "the scores of stones are those of the table"),
            Some(difference) => fails(&name, format!("is not that of the table: {difference}")),
        },
    )
}

/// The report and the layers, made from the other files again.
fn made_again(results: &Path, run: &RunRecord) -> Result<Vec<Finding>> {
    let scratch = scratch()?;
    copy_results(results, scratch.path())?;
    let reports = named_results_in(results)?
        .into_iter()
        .filter(|file| is_of_report(file));
    let mut files: Vec<PathBuf> = reports.collect();
    // A run that ended with the registration has neither.
    if files.is_empty() {
        return Ok(Vec::new());
    }
    files.extend(
        [
            GEOPACKAGE,
            GEOPARQUET,
            FACES_VTP,
            DISPLACEMENTS_VTP,
            FACES_PLY,
            DRAWING,
        ]
        .map(PathBuf::from),
    );
    write_report(scratch.path())?;
    write_layers(scratch.path())?;
    let other_maker = Maker::of(run).differs(&Maker::present());
    let compared = |file: &PathBuf| {
        let [found, made] = [results, scratch.path()].map(|folder| fs::read(folder.join(file)).ok());
        match (&found, &other_maker) {
            (Some(_), _) if found == made => {
                Finding::of(file, KIND, Answer::Holds, "is what the tables give")
            }
            (Some(_), Some(why)) => {
                let message = format!("cannot be compared byte for byte: it was made by {why}");
                Finding::of(file, KIND, Answer::Open, message)
            }
            (Some(_), None) => Finding::of(file, KIND, Answer::Fails, "is not what the tables give"),
            // An earlier version may not have written it; what the run did write is among its digests.
            (None, Some(why)) => {
                let message = format!("is missing; the results were made by {why}");
                Finding::of(file, KIND, Answer::Open, message)
            }
            (None, None) => Finding::of(file, KIND, Answer::Fails, "is missing"),
        }
    };
    Ok(files.iter().map(compared).collect())
}

/// The tables, records and excerpts that reports and layers are made from.
fn copy_results(from: &Path, to: &Path) -> Result<()> {
    let sources = |file: &PathBuf| {
        let is_cloud = file.extension().is_some_and(|e| e == "laz");
        !is_cloud && !is_of_report(file)
    };
    for file in named_results_in(from)?.into_iter().filter(sources) {
        copy(&from.join(&file), &to.join(&file))?;
    }
    Ok(())
}

pub(super) fn copy(from: &Path, to: &Path) -> Result<()> {
    if let Some(parent) = to.parent() {
        fs::create_dir_all(parent).map_err(Error::io("making a folder", parent))?;
    }
    fs::copy(from, to).map(drop).map_err(Error::io("copying", from))
}

fn text(path: &Path) -> Result<String> {
    fs::read_to_string(path).map_err(Error::io("reading", path))
}
