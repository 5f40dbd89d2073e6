//! Measures the adjustment on surveys with truth and true labels: the source of the tables of
//! docs/src/accuracy.md.
//!
//! `cargo run -p stonewise-core --example measure_adjustment [WORD ...]`. Words, in any order: cases `still
//! translation bulge edge crack settlement loose combo datum` (default: all; `edge`: one bulge at the end of
//! a wall that stood still, `datum`: combo with the true motion taken out again), sensors `tls uav` (default:
//! both), `seeds=N` (simulated walls, default 5), `seed=N` (one of them), `dam` (the section beside the
//! checkout instead, or that in `STONEWISE_SURVEY`), `exact` (epochs without registration and trajectory
//! errors), `masks` (15 % of the second epoch's masks merged, halved or swapped), `paper` (the paper's
//! estimator and M3C2 beside it), `each` (a line for every seed), `width=M height=M` (of the wall, default 4
//! by 3), `coarse=F` (point spacing times F), `border=F` (width of the border, in noise levels, where a
//! point's place decides and not its label, as in a run; default 3), `set:KEY=F` (a parameter of the
//! adjustment), `scale=N` (time for about N stones). A row holds medians over the seeds. Millimetres.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

mod bound;
mod dam;
#[allow(dead_code)] // sources and times are for another example
#[path = "../shared/dam_small.rs"]
mod dam_small;
mod figures;
mod paper;
mod scale;
mod simulated;
mod trial;

use figures::{Figures, figures, median};
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

/// The words of the command line.
#[derive(Clone)]
pub struct Options {
    words: Vec<String>,
    pub exact: bool,
    pub width_m: f64,
    pub height_m: f64,
    coarse: f64,
    pub border_noises: f64,
}

impl Options {
    fn new(words: Vec<String>) -> Self {
        let number = |key: &str| {
            words
                .iter()
                .find_map(|w| w.strip_prefix(key)?.parse::<f64>().ok())
        };
        Self {
            exact: words.iter().any(|w| w == "exact"),
            width_m: number("width=").unwrap_or(4.0),
            height_m: number("height=").unwrap_or(3.0),
            coarse: number("coarse=").unwrap_or(1.0),
            border_noises: number("border=").unwrap_or(3.0),
            words,
        }
    }

    fn has(&self, word: &str) -> bool {
        self.words.iter().any(|w| w == word)
    }

    fn number(&self, key: &str) -> Option<u64> {
        self.words.iter().find_map(|w| w.strip_prefix(key)?.parse().ok())
    }

    /// Those that are named; all where none is.
    fn chosen<'a>(&self, names: &[&'a str]) -> Vec<&'a str> {
        let some: Vec<&str> = names.iter().copied().filter(|n| self.has(n)).collect();
        if some.is_empty() { names.to_vec() } else { some }
    }

    /// Parameters of the adjustment, with those that are set by words.
    pub fn params(&self) -> AdjustmentParams {
        let mut params = serde_json::to_value(AdjustmentParams::default()).unwrap();
        for (key, value) in self
            .words
            .iter()
            .filter_map(|w| w.strip_prefix("set:")?.split_once('='))
        {
            params[key] = value.parse().unwrap();
        }
        serde_json::from_value(params).unwrap()
    }

    /// Point spacing of a survey, metres.
    pub fn spacing(&self, usual_m: f64) -> f64 {
        usual_m * self.coarse
    }
}

fn main() {
    let options = Options::new(std::env::args().skip(1).collect());
    let sensors = options.chosen(&["tls", "uav"]);
    if let Some(stones) = options.number("scale=") {
        sensors
            .iter()
            .for_each(|s| scale::measure(s, stones as usize, &options));
        return;
    }
    let seeds: Vec<u64> = match (options.has("dam"), options.number("seed=")) {
        (true, _) => vec![0],
        (false, Some(seed)) => vec![seed],
        (false, None) => (1..=options.number("seeds=").unwrap_or(5)).collect(),
    };
    if options.has("dam") && !dam::folder().is_dir() {
        println!("skipped: no survey data");
        return;
    }
    let names: Vec<&str> = Case::ALL.iter().map(|c| c.0).collect();
    println!("{HEAD}");
    for name in options.chosen(&names) {
        for sensor in &sensors {
            let case = Case::ALL.iter().find(|c| c.0 == name).unwrap().1;
            measure(case, sensor, &seeds, &options);
        }
    }
}

const HEAD: &str = "case        sensor  | share in2D   out | no datum   out | >1cm | loose P    R  max | cover a    u    o | chi2 mean med | alarms FDR  | against   >95% | bound in   out window    out | crack  good bad span | spoilt flagged wrong | s";

fn measure(case: Case, sensor: &str, seeds: &[u64], options: &Options) {
    let (mut adjusted, mut paper, mut m3c2) = (Vec::new(), Vec::new(), [Vec::new(), Vec::new()]);
    for &seed in seeds {
        let trial = if options.has("dam") {
            dam::build(case, sensor)
        } else {
            (case != Case::Datum).then(|| simulated::build(case, sensor, seed, options))
        };
        let Some(mut trial) = trial else { continue };
        if options.has("masks") {
            trial.spoil();
        }
        let source = MemoryPairs::new(trial.pairs(options.border_noises));
        let found = adjusted_figures(&trial, &source, options);
        if options.has("each") {
            println!("{}", line(&format!("{case:?} {seed}"), sensor, &[found]));
        }
        adjusted.push(found);
        if options.has("paper") {
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
    println!("{}", line(&format!("{case:?}"), sensor, &adjusted));
    if !paper.is_empty() {
        println!("{}", line("  gicp", sensor, &paper));
        let [inside, out] = m3c2.map(|mut list| median(&mut list));
        println!("  m3c2      {sensor:6}  |       {inside:5.2} {out:5.2}");
    }
}

fn adjusted_figures(trial: &Trial, source: &MemoryPairs, options: &Options) -> Figures {
    let start = std::time::Instant::now();
    let report = adjust(source, &options.params(), &Silent).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    if options.has("each") {
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
    if options.has("each") {
        figures::print_loose(trial, source.pairs(), &report.results);
    }
    found
}

/// Medians of the runs as one row.
fn line(name: &str, sensor: &str, runs: &[Figures]) -> String {
    let m = |of: &dyn Fn(&Figures) -> f64| median(&mut runs.iter().map(of).collect());
    let c = |k: usize| m(&|f| f.coverage[k]);
    let b = |k: usize| m(&|f| f.bounds[k]);
    format!(
        "{name:12}{sensor:6}  | {:5.3} {:5.3} {:5.3} | {:8.3} {:5.3} | {:4.1} | {:7.2} {:4.2} {:4.2} | {:7.3} {:4.2} {:4.2} | {:9.2} {:3.2} | {:6.3} {:.3} | {:7.2} {:6.3} | {:8.3} {:5.3} {:6.3} {:6.3} | {:5.2} {:5} {:3} {:4.2} | {:14.2} {:5.2} | {:.1}",
        m(&|f| f.measured),
        m(&|f| f.in_plane),
        m(&|f| f.out),
        m(&|f| f.no_datum_in),
        m(&|f| f.no_datum_out),
        m(&|f| f.beyond) * 100.0,
        m(&|f| f.precision),
        m(&|f| f.recall),
        m(&|f| f.possible),
        c(0),
        c(1),
        c(2),
        m(&|f| f.normalised[0]),
        m(&|f| f.normalised[1]),
        m(&|f| f.alarms[0]),
        m(&|f| f.alarms[1]),
        m(&|f| f.against[0]),
        m(&|f| f.against[1]),
        b(0),
        b(1),
        b(2),
        b(3),
        m(&|f| f.crack[0]),
        m(&|f| f.crack[1]),
        m(&|f| f.crack[2]),
        m(&|f| f.crack[3]),
        m(&|f| f.spoilt[0]),
        m(&|f| f.spoilt[1]),
        m(&|f| f.seconds),
    )
}
