//! The yardstick: the one place where a change of the method is judged, on surveys of which the truth is known.
//!
//! `lab yardstick quick|full [--out FOLDER] [--filter NAME,...] [--off NAME,...] [--set KEY=VALUE,...]
//! [--results FOLDER]` measures each survey whose name holds one of the NAMEs, writes its figures into FOLDER as a line
//! of JSON (those that are there already are kept) and prints a table: a row is the mean of surveys that differ in their
//! seed alone. `--off` switches mechanisms off (in a build with `--features switches`), `--set` sets parameters of the
//! adjustment, `--results` holds results of runs of the real surveys, each in a folder of its name.
//!
//! `lab yardstick compare FOLDER FOLDER [--filter NAME]` says which figures of the second are better or worse than
//! those of the first.
//!
//! True labels and matches, clouds alone. `free_*` claims are about motions less the rigid motion in common,
//! `absolute_*` about motions where the datum is known, `relative_*` about motions against the neighbours.

mod compare;
mod event;
mod figures;
mod measure;
mod photos;
mod plan;
mod points;
mod series;
mod stored;
mod surveys;
mod wall;

use crate::Outcome;
use crate::table::Table;
use crate::words::Words;
use figures::{Figures, LEVELS};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hasher};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use stonewise_core::registration::AdjustmentParams;
use stonewise_io::atomic::write_atomically;
use surveys::Survey;

/// The columns of the table: head, decimals, and the figures that share a cell; `KIND_*` is the coverage of the four
/// levels.
const HEADS: [(&str, usize, &str); 28] = [
    ("measured", 2, "measured"),
    ("RMSE in face / out, mm", 2, "in_rmse out_rmse"),
    ("median in face / out", 2, "in_median out_median"),
    ("coverage of 50 / 80 / 95 / 99 %", 2, "free_*"),
    ("interval score", 2, "free_score"),
    ("PIT", 2, "pit"),
    ("chi-square", 2, "chi_square"),
    ("absolute RMSE", 2, "absolute_rmse"),
    ("coverage", 2, "absolute_*"),
    ("score", 2, "absolute_score"),
    ("relative coverage", 2, "relative_*"),
    ("score", 2, "relative_score"),
    ("deformation RMSE", 2, "deformation_rmse"),
    ("coverage", 2, "deformation_*"),
    ("score", 2, "deformation_score"),
    (
        "areas found / missed / false",
        1,
        "areas_found areas_missed areas_false",
    ),
    ("sizes held", 2, "areas_held"),
    ("loose: precision / recall", 2, "loose_precision loose_recall"),
    ("islands", 1, "islands"),
    ("odd refused", 2, "refused_odd"),
    ("verdicts false / missed", 2, "false_verdict missed_verdict"),
    ("velocity RMSE, mm/a", 3, "velocity_rmse"),
    ("coverage", 2, "velocity_*"),
    ("creep / steps named", 2, "creep_named steps_named"),
    ("datum known", 1, "datum_known"),
    ("surveys", 0, "surveys"),
    ("s", 1, "seconds"),
    ("MB", 0, "memory_mb"),
];

/// What is kept of a measured survey.
#[derive(Serialize, Deserialize)]
struct Line {
    survey: String,
    settings: Settings,
    figures: Figures,
}

/// By what it was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Settings {
    /// Digest of the program.
    program: String,
    off: Vec<String>,
    set: Vec<String>,
}

pub fn run(words: &Words) -> Outcome {
    match words.as_slice().first().map(String::as_str) {
        Some("quick") => all(words, true),
        Some("full") => all(words, false),
        Some("compare") => compare::run(words),
        _ => Err("say what: lab yardstick quick, full or compare FOLDER FOLDER".into()),
    }
}

fn all(words: &Words, is_quick: bool) -> Outcome {
    let list = |option: &str| -> Vec<String> {
        words
            .option(option)
            .map_or(Vec::new(), |l| l.split(',').map(str::to_owned).collect())
    };
    let settings = Settings {
        program: program()?,
        off: list("--off"),
        set: list("--set"),
    };
    switch_off(&settings.off)?;
    let params = params(&settings.set)?;
    let folder = PathBuf::from(words.option("--out").unwrap_or("yardstick"));
    std::fs::create_dir_all(&folder)?;
    let filter = words.option("--filter").unwrap_or_default();
    let chosen: Vec<Survey> = surveys::all()
        .into_iter()
        .filter(|s| (s.is_quick || !is_quick) && filter.split(',').any(|f| s.name.contains(f)))
        .collect();
    let (mut lines, mut missing) = (Vec::new(), Vec::new());
    for survey in &chosen {
        let file = folder.join(format!("{}.json", survey.name));
        if file.is_file() {
            let line = read(&file)?;
            if line.settings != settings {
                let why = "another program or other settings wrote it: name another folder with --out";
                return Err(format!("{}: {why}", file.display()).into());
            }
            lines.push(line);
            continue;
        }
        eprintln!("{}", survey.name);
        let figures = || survey.figures(&params, words.option("--results"));
        // A panic is the failure of one survey.
        match catch_unwind(AssertUnwindSafe(figures)).unwrap_or_else(|_| Err("it panicked".into())) {
            Ok(figures) => {
                let line = Line {
                    survey: survey.name.clone(),
                    settings: settings.clone(),
                    figures,
                };
                let text = serde_json::to_string(&line)? + "\n";
                write_atomically(&file, |partial| std::fs::write(partial, &text))?;
                lines.push(line);
            }
            Err(why) => missing.push(format!("{}: {why}", survey.name)),
        }
    }
    print(&lines);
    for why in missing {
        println!("\nNot measured: {why}.");
    }
    Ok(())
}

fn read(file: &Path) -> Result<Line, Box<dyn std::error::Error>> {
    let text = std::fs::read_to_string(file)?;
    Ok(serde_json::from_str(&text).map_err(|e| format!("{}: {e}", file.display()))?)
}

/// Prints the means of surveys that differ in their seed alone.
fn print(lines: &[Line]) {
    let mut groups: BTreeMap<&str, Vec<&Figures>> = BTreeMap::new();
    for line in lines {
        let group = Survey::group(&line.survey);
        groups.entry(group).or_default().push(&line.figures);
    }
    let table = Table::begin(std::iter::once("survey").chain(HEADS.map(|h| h.0)));
    for (group, all) in groups {
        let figure = |name: &str, digits: usize| {
            let known: Vec<f64> = all.iter().filter_map(|f| f.get(name).copied()).collect();
            match (name, known.is_empty()) {
                ("surveys", _) => all.len().to_string(),
                (_, true) => "\u{2013}".to_owned(),
                _ => format!("{:.digits$}", known.iter().sum::<f64>() / known.len() as f64),
            }
        };
        let cell = |(_, digits, names): &(&str, usize, &str)| {
            let names: Vec<String> = match names.strip_suffix('*') {
                Some(kind) => LEVELS.map(|(_, text)| format!("{kind}{text}")).to_vec(),
                None => names.split(' ').map(str::to_owned).collect(),
            };
            let cells: Vec<String> = names.iter().map(|n| figure(n, *digits)).collect();
            cells.join(" / ")
        };
        table.row(std::iter::once(group.to_owned()).chain(HEADS.iter().map(cell)));
    }
}

/// The lines of a folder by survey.
fn lines(folder: &Path) -> Result<BTreeMap<String, Figures>, Box<dyn std::error::Error>> {
    let mut all = BTreeMap::new();
    for file in std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))? {
        let file = file?.path();
        if file.extension().is_some_and(|e| e == "json") {
            let line = read(&file)?;
            all.insert(line.survey, line.figures);
        }
    }
    Ok(all)
}

fn params(set: &[String]) -> Result<AdjustmentParams, Box<dyn std::error::Error>> {
    let mut params = serde_json::to_value(AdjustmentParams::default())?;
    for text in set {
        let (key, value) = text
            .split_once('=')
            .ok_or(format!("--set {text}: write KEY=VALUE"))?;
        params[key] = serde_json::from_str(value)?;
    }
    Ok(serde_json::from_value(params)?)
}

/// A digest of this program, so that no folder holds the figures of two.
fn program() -> Result<String, std::io::Error> {
    let mut hasher = DefaultHasher::new();
    hasher.write(&std::fs::read(std::env::current_exe()?)?);
    Ok(format!("{:016x}", hasher.finish()))
}

#[cfg(feature = "switches")]
fn switch_off(names: &[String]) -> Outcome {
    Ok(stonewise_core::switches::switch_off(names)?)
}

#[cfg(not(feature = "switches"))]
fn switch_off(names: &[String]) -> Outcome {
    match names.is_empty() {
        true => Ok(()),
        false => Err("--off needs a build with `--features switches`".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use figures::columns;

    #[test]
    fn the_table_shows_figures_that_there_are() {
        let known: Vec<String> = columns().into_iter().map(|c| c.0).collect();
        for names in HEADS.iter().flat_map(|h| h.2.split(' ')) {
            let name = names.replace('*', "95");
            assert!(name == "surveys" || known.contains(&name), "{name}");
        }
    }
}
