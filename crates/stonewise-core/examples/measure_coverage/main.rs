//! Measures how often the intervals of absolute motions hold the truth, over many small surveys: the source
//! of the table in docs/src/method/epoch-errors.md.
//!
//! `cargo run --release -p stonewise-core --example measure_coverage [WORD ...]`. Words: sensors `tls uav`
//! (default both), kinds of error by their names (`usual walk jump ...`, see [`errors::Kind`]; default all),
//! `sources=2,3` (numbers of stations or strips of an epoch), `stable=none,ground,building,moved` (default
//! none), `without=times,sources` (what the files leave out), `walls=N` (of a row, default 200), `first=N`
//! (seed of the first wall), `full` (walls of 3 x 2 m with a bulge, scanned and adjusted; minutes for a few
//! walls; no stable areas).
//!
//! A row pools the stones of its walls. Errors are shared by all stones of a wall, so ranges are those of
//! walls drawn anew (percentile bootstrap, Efron 1979); the first row says between which figures the coverage
//! of a perfect method would lie.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

mod ablation;
mod errors;
mod figures;
mod full;
mod survey;

use ablation::Kept;
use errors::{Kind, Sensor};
use figures::{Wall, print, print_head};
use rayon::prelude::*;
use stonewise_core::registration::observers::{EpochErrorParams, EpochPair, epoch_errors};
use survey::{Case, Stable, simulate};

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let list = |key: &str, default: &str| -> Vec<String> {
        let given = words.iter().find_map(|w| w.strip_prefix(key));
        given.unwrap_or(default).split(',').map(str::to_owned).collect()
    };
    let number = |key: &str, default: &str| list(key, default)[0].parse::<u64>().unwrap();
    let has = |name: &str| words.iter().any(|w| w == name);
    let all_kinds = !Kind::ALL.iter().any(|(name, _)| has(name));
    let sensors = [("tls", Sensor::Tls, "2,3,4"), ("uav", Sensor::Uav, "3,4,6")];
    let all_sensors = !sensors.iter().any(|s| has(s.0));
    let (walls, first) = (number("walls=", "200"), number("first=", "1"));
    let without = list("without=", "");
    let is_kept = |part: &str| !without.iter().any(|w| w == part);
    let kept = Kept {
        times: is_kept("times"),
        sources: is_kept("sources"),
    };
    print_head(walls);
    for (sensor_name, sensor, usual) in sensors.into_iter().filter(|s| all_sensors || has(s.0)) {
        for stable in list("stable=", "none") {
            for sources in list("sources=", usual) {
                for (kind_name, kind) in Kind::ALL {
                    if !kind.suits(sensor) || !(all_kinds || has(kind_name)) {
                        continue;
                    }
                    let case = Case {
                        sensor,
                        sources: sources.parse().unwrap(),
                        stable: stable_of(&stable),
                        kind,
                    };
                    let started = std::time::Instant::now();
                    let found: Vec<Wall> = (first..first + walls)
                        .into_par_iter()
                        .map(|seed| measure(&case, seed, has("full"), kept))
                        .collect();
                    let label = format!("{sensor_name} {sources} {stable} {kind_name}");
                    print(&label, &found, started.elapsed().as_secs_f64());
                }
            }
        }
    }
}

fn stable_of(word: &str) -> Stable {
    match word {
        "ground" => Stable::Ground,
        "building" => Stable::Building,
        "moved" => Stable::Moved,
        _ => Stable::None,
    }
}

fn measure(case: &Case, seed: u64, is_full: bool, kept: Kept) -> Wall {
    let survey = match is_full {
        true => full::simulate(case, seed),
        false => simulate(case, seed),
    };
    let survey = kept.apply(survey);
    let same: Vec<usize> = (0..survey.sources.len()).collect();
    let pair = EpochPair {
        sources: &survey.sources,
        same_as: &same,
        stones: &survey.stones,
        neighbours: &[],
        stable: &survey.stable,
        offered: &[],
        sigma_m: survey.sigma_m,
    };
    Wall::new(&survey, &epoch_errors(&pair, &EpochErrorParams::default()))
}
