//! Measures how often the intervals of absolute motions hold the truth, over many small surveys: the source
//! of the table in docs/src/method/epoch-errors.md.
//!
//! `cargo run --release -p stonewise-lab -- coverage [WORD ...]`. Words: sensors `tls uav`
//! (default both), kinds of error by their names (`usual walk jump ...`, see [`errors::Kind`]; default all),
//! `sources=2,3` (numbers of stations or strips of an epoch), `stable=none,ground,building,moved,buildings` (default
//! none), `without=times,sources` (what the files leave out), `walls=N` (of a row, default 200), `first=N`
//! (seed of the first wall), `full` (walls of 3 x 2 m with a bulge, scanned and adjusted; minutes for a few
//! walls; no stable areas).
//!
//! A row pools the stones of its walls. Errors are shared by all stones of a wall, so ranges are those of
//! walls drawn anew (percentile bootstrap, Efron 1979); the first row says between which figures the coverage
//! of a perfect method would lie. "Over calibrated": mean scores over those of a normal distribution as wide as the
//! errors (see [`crate::sharpness`]).

mod ablation;
mod errors;
mod figures;
mod full;
mod small_wall;

use crate::Outcome;
use crate::words::Words;
use ablation::Kept;
use errors::{Kind, Sensor};
use figures::{Wall, begin, cells};
use rayon::prelude::*;
use small_wall::{Case, Stable, simulate};
use stonewise_core::progress::{Interrupted, Silent};
use stonewise_core::registration::observers::{EpochErrorParams, EpochPair, epoch_errors};

pub fn run(words: &Words) -> Outcome {
    let all_kinds = !Kind::ALL.iter().any(|(name, _)| words.has(name));
    let sensors = [("tls", Sensor::Tls, "2,3,4"), ("uav", Sensor::Uav, "3,4,6")];
    let all_sensors = !sensors.iter().any(|s| words.has(s.0));
    let walls: u64 = words.number("walls=").unwrap_or(200);
    let first: u64 = words.number("first=").unwrap_or(1);
    let without = words.list("without=", "");
    let is_kept = |part: &str| !without.iter().any(|w| w == part);
    let kept = Kept {
        times: is_kept("times"),
        sources: is_kept("sources"),
    };
    let table = begin(walls);

    for (sensor_name, sensor, usual) in sensors.into_iter().filter(|s| all_sensors || words.has(s.0)) {
        for stable in words.list("stable=", "none") {
            for sources in words.list("sources=", usual) {
                for (kind_name, kind) in Kind::ALL {
                    if !kind.suits(sensor) || !(all_kinds || words.has(kind_name)) {
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
                        .map(|seed| measure(&case, seed, words.has("full"), kept))
                        .collect::<Result<_, Interrupted>>()?;
                    let label = format!("{sensor_name} {sources} {stable} {kind_name}");
                    table.row(cells(&label, found, started.elapsed().as_secs_f64()));
                }
            }
        }
    }

    Ok(())
}

fn stable_of(word: &str) -> Stable {
    match word {
        "ground" => Stable::Ground,
        "building" => Stable::Building,
        "moved" => Stable::Moved,
        "buildings" => Stable::Buildings,
        _ => Stable::None,
    }
}

fn measure(case: &Case, seed: u64, is_full: bool, kept: Kept) -> Result<Wall, Interrupted> {
    let survey = match is_full {
        true => full::simulate(case, seed),
        false => simulate(case, seed),
    };
    let survey = kept.apply(survey);
    let with = |stable| {
        let pair = EpochPair {
            stable,
            ..EpochPair::new(&survey.sources, &survey.stones, survey.sigma_m)
        };
        epoch_errors(&pair, &EpochErrorParams::default(), &Silent)
    };
    let found = with(&survey.stable)?;
    let without = match survey.stable.is_empty() {
        true => None,
        false => Some(with(&[])?),
    };
    Ok(Wall::new(&survey, &found, without.as_ref()))
}
