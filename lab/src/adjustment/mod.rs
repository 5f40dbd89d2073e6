//! Measures the adjustment on surveys with truth and true labels: the source of the tables of
//! docs/src/accuracy.md.
//!
//! `cargo run --release -p stonewise-lab -- adjustment [WORD ...]`. Words, in any order: cases `still translation bulge
//! edge crack settlement loose combo datum` (default: all; `edge`: one bulge at the end of a wall that stood still,
//! `datum`: combo with the true motion taken out again), sensors `tls uav` (default: both; `tls-uav uav-tls`: another
//! sensor in each epoch, with `dam`), `seeds=N` (simulated walls, default 5), `seed=N` (one of them), `dam` (the
//! section beside the checkout instead, or that in `STONEWISE_SURVEY`), `exact` (epochs without registration and
//! trajectory errors), `masks` (15 % of the second epoch's masks merged, halved or swapped), `paper` (the paper's
//! estimator and M3C2 beside it), `each` (a line for every seed), `width=M height=M` (of the wall, default 4 by 3),
//! `coarse=F` (point spacing times F), `border=F` (width of the border, in noise levels, where a point's place decides
//! and not its label, as in a run; default 3), `set:KEY=F` (a parameter of the adjustment), `scale=N` (time for about N
//! stones), `mixes` (noise of 1, 3, 6, 11 and 20 mm and 100, 28 and 10 % of the points in the first, the second and
//! both epochs of simulated walls; `noise=MM,... share=PERCENT,...` for others). A row holds medians over the seeds.
//! Millimetres.

mod bound;
mod dam;
mod figures;
mod mix;
mod paper;
mod scale;
mod simulated;
mod trial;

use crate::Outcome;
use crate::figures::median;
use crate::table::{Figure, Table};
use crate::words::Words;
use figures::{COLUMNS, Figures, figures};
use mix::Mix;
use stonewise_core::progress::Silent;
use stonewise_core::registration::{AdjustmentParams, MemoryPairs, adjust};
use trial::Trial;

/// What happened between the epochs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Case {
    Still,
    Translation,
    Bulge,
    /// One bulge at the end of a wall that stood still elsewhere.
    Edge,
    Crack,
    Settlement,
    Loose,
    Combo,
    /// Combo with the true motion taken out of the points: what remains is the datum.
    Datum,
}

impl Case {
    const ALL: [(&'static str, Self); 9] = [
        ("still", Self::Still),
        ("translation", Self::Translation),
        ("bulge", Self::Bulge),
        ("edge", Self::Edge),
        ("crack", Self::Crack),
        ("settlement", Self::Settlement),
        ("loose", Self::Loose),
        ("combo", Self::Combo),
        ("datum", Self::Datum),
    ];

    /// One epoch split into halves, as in the paper, instead of two epochs.
    pub fn is_split(self) -> bool {
        matches!(self, Self::Translation | Self::Bulge | Self::Crack)
    }
}

/// What the words choose.
#[derive(Clone)]
pub struct Options {
    words: Words,
    pub exact: bool,
    pub width_m: f64,
    pub height_m: f64,
    coarse: f64,
    pub border_noises: f64,
    /// What is done to the points of an epoch.
    pub mix: Option<Mix>,
}

impl Options {
    fn new(words: &Words) -> Self {
        let number = |key: &str, default: f64| words.number(key).unwrap_or(default);
        Self {
            exact: words.has("exact"),
            width_m: number("width=", 4.0),
            height_m: number("height=", 3.0),
            coarse: number("coarse=", 1.0),
            border_noises: number("border=", 3.0),
            mix: None,
            words: words.clone(),
        }
    }

    /// Parameters of the adjustment, with those that are set by words.
    pub fn params(&self) -> AdjustmentParams {
        let mut params = serde_json::to_value(AdjustmentParams::default()).unwrap();
        let words = self.words.as_slice().iter();
        for (key, value) in words.filter_map(|w| w.strip_prefix("set:")?.split_once('=')) {
            params[key] = value.parse().unwrap();
        }
        serde_json::from_value(params).unwrap()
    }

    /// Point spacing of a survey, metres.
    pub fn spacing(&self, usual_m: f64) -> f64 {
        usual_m * self.coarse
    }
}

pub fn run(words: &Words) -> Outcome {
    let options = Options::new(words);
    let sensors = sensors(words);
    if let Some(stones) = words.number("scale=") {
        for sensor in &sensors {
            scale::measure(sensor, stones, &options);
        }
        return Ok(());
    }
    let seeds: Vec<u64> = match (words.has("dam"), words.number("seed=")) {
        (true, _) => vec![0],
        (false, Some(seed)) => vec![seed],
        (false, None) => (1..=words.number("seeds=").unwrap_or(5)).collect(),
    };
    if words.has("dam") && !dam::folder().is_dir() {
        println!("skipped: no survey data");
        return Ok(());
    }
    let table = Table::begin(["case", "sensor"].into_iter().chain(COLUMNS.map(|c| c.0)));
    if words.has("mixes") {
        for mix in Mix::chosen(words) {
            let options = Options {
                mix: Some(mix),
                ..options.clone()
            };
            measure(Case::Combo, "tls", &seeds, &options, &table);
        }
        return Ok(());
    }
    for name in words.chosen(&Case::ALL.map(|c| c.0)) {
        for (_, case) in Case::ALL.iter().filter(|c| c.0 == name) {
            for sensor in &sensors {
                measure(*case, sensor, &seeds, &options, &table);
            }
        }
    }
    Ok(())
}

/// Scanner and drone, unless words choose; mixes only if they do.
fn sensors(words: &Words) -> Vec<&'static str> {
    const SENSORS: [&str; 4] = ["tls", "uav", "tls-uav", "uav-tls"];
    match SENSORS.iter().any(|s| words.has(s)) {
        true => words.chosen(&SENSORS),
        false => SENSORS[..2].to_vec(),
    }
}

fn measure(case: Case, sensor: &str, seeds: &[u64], options: &Options, table: &Table) {
    let (mut adjusted, mut paper, mut m3c2) = (Vec::new(), Vec::new(), [Vec::new(), Vec::new()]);
    for &seed in seeds {
        let trial = if options.words.has("dam") {
            dam::build(case, sensor)
        } else {
            (case != Case::Datum).then(|| simulated::build(case, sensor, seed, options))
        };
        let Some(mut trial) = trial else { continue };
        if options.words.has("masks") {
            trial.spoil();
        }
        let source = MemoryPairs::new(trial.pairs(options.border_noises));
        let found = adjusted_figures(&trial, &source, options);
        if options.words.has("each") {
            table.row(cells(&format!("{case:?} {seed}"), sensor, &[found]));
        }
        adjusted.push(found);
        if options.words.has("paper") {
            let start = std::time::Instant::now();
            let results = paper::gicp(&trial, &source);
            paper.push(figures(&trial, &results, &[], start.elapsed().as_secs_f64()));
            for (list, error) in m3c2.iter_mut().zip(paper::m3c2_errors(&trial, &source)) {
                list.push(error);
            }
        }
    }
    if adjusted.is_empty() {
        return;
    }
    let name = options
        .mix
        .as_ref()
        .map_or_else(|| format!("{case:?}"), Mix::name);
    table.row(cells(&name, sensor, &adjusted));
    if !paper.is_empty() {
        table.row(cells("its gicp", sensor, &paper));
        let [inside, out] = m3c2.map(|list| format!("{:.2}", median(list)));
        table.row([
            "its m3c2".to_owned(),
            sensor.to_owned(),
            String::new(),
            inside,
            out,
        ]);
    }
}

fn adjusted_figures(trial: &Trial, source: &MemoryPairs, options: &Options) -> Figures {
    let start = std::time::Instant::now();
    let report = adjust(source, &options.params(), &Silent).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    if options.words.has("each") {
        println!(
            "    {:?} sigma {:.2?} mm roughness {:.3} mm cell {:.1} mm f {:.2} common {:.2?} +- {:.2?} mm, {} iterations{}",
            report.components,
            report.sigma_m.map(|s| s * 1e3),
            report.roughness_m * 1e3,
            report.cell_m * 1e3,
            report.correlation_factor,
            (report.common_motion * 1e3).as_slice(),
            report
                .common_covariance
                .diagonal()
                .map(|v| 1e3 * v.sqrt())
                .as_slice(),
            report.iterations,
            if report.converged { "" } else { ", NOT CONVERGED" }
        );
    }
    let found = figures(trial, &report.results, &report.breaks, seconds);
    if options.words.has("each") {
        figures::print_loose(trial, source.pairs(), &report.results);
    }
    found
}

/// Medians of the runs as one row.
fn cells(name: &str, sensor: &str, runs: &[Figures]) -> Vec<String> {
    let median = |(_, digits, of): &Figure<Figures>| format!("{:.digits$}", median(runs.iter().map(of)));
    let names = [name.to_owned(), sensor.to_owned()];
    names.into_iter().chain(COLUMNS.iter().map(median)).collect()
}
