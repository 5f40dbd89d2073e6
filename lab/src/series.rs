//! Measures what is said of series of scanned walls: errors and intervals of velocities, and what is claimed of
//! walls on which nothing happens.
//!
//! `cargo run --release -p stonewise-lab -- series [WORD ...]`. Words: `walls=N` (of a row, default 20), `first=N` (seed of
//! the first wall), `epochs=N` (default 6, half a year apart), `creep=0,2` (of the middle of a bulge of 1.2 m, mm a
//! year), `step=MM` (a settlement of the right third before the fourth epoch, default 0), `size=3x2` (of the wall, m).
//! Every wall has stones, stations and errors of its own in each epoch; each later epoch is adjusted against the first
//! with true labels.
//!
//! Columns: coverage of the 95 % intervals of velocities along, up and out; root mean square of their errors and
//! standard deviations, mm a year; walls of which a trend, an anomaly, a newest epoch that is not as predicted or not as
//! in the past is claimed; share of stones that creep by more than half of the bulge and are named.

use crate::Outcome;
use crate::figures::{coverage, rms_of_axes};
use crate::survey::ScannedWall;
use crate::table::Table;
use crate::words::Words;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use stonewise_core::geometry::FaceFrame;
use stonewise_core::id::StoneId;
use stonewise_core::series::{
    PairLook, SeriesAnswers, SeriesEpoch, SeriesPlace, StoneSeries, Word, analyse, keep_congruent,
};
use stonewise_simulate::{SceneParams, TlsParams, WallMotion, WallParams};

/// Years from one epoch to the next.
const APART: f64 = 0.5;
/// The first epoch after the step.
const STEP_EPOCH: usize = 3;
const STATIONS: u32 = 2;

pub fn run(words: &Words) -> Outcome {
    let walls: u64 = words.number("walls=").unwrap_or(20);
    let first: u64 = words.number("first=").unwrap_or(1);
    let size = words.after("size=").unwrap_or("3x2");
    let size: Vec<f64> = size.split('x').map(|s| s.parse().unwrap()).collect();
    let table = Table::begin([
        "creep mm/a",
        "walls",
        "held along",
        "up",
        "out",
        "error mm/a",
        "sd mm/a",
        "trend",
        "anomaly",
        "not predicted",
        "not past",
        "named",
        "s",
    ]);
    for creep in words.list("creep=", "0,2") {
        let case = Case {
            epochs: words.number("epochs=").unwrap_or(6) as usize,
            size: [size[0], size[1]],
            creep_m: creep.parse::<f64>().unwrap() / 1e3,
            step_m: words
                .after("step=")
                .map_or(0.0, |s| s.parse::<f64>().unwrap() / 1e3),
        };
        let started = std::time::Instant::now();
        let found: Vec<Wall> = (first..first + walls)
            .into_par_iter()
            .map(|seed| case.measure(seed))
            .collect();
        table.row(cells(&creep, &found, started.elapsed().as_secs_f64()));
    }
    Ok(())
}

struct Case {
    epochs: usize,
    size: [f64; 2],
    creep_m: f64,
    step_m: f64,
}

/// What was found of a wall.
struct Wall {
    /// Error and standard deviation of each velocity along, up and out, metres a year.
    stones: Vec<[Vector3<f64>; 2]>,
    answers: SeriesAnswers,
    /// Stones that creep by more than half of the bulge, and those of them that are named.
    creeping: [usize; 2],
}

impl Case {
    fn params(&self, seed: u64, epoch: usize) -> SceneParams {
        let mut motions = Vec::new();
        if self.creep_m != 0.0 {
            motions.push(WallMotion::Bulge {
                centre_m: [0.2, 0.5 * self.size[1]],
                depth_m: self.creep_m * APART * epoch as f64,
                diameter_m: 1.2,
            });
        }
        if self.step_m != 0.0 && epoch >= STEP_EPOCH {
            let edge = self.size[0] / 6.0;
            motions.push(WallMotion::Settlement {
                from_m: edge,
                to_m: edge + 0.1,
                depth_m: self.step_m,
            });
        }
        SceneParams {
            wall: WallParams {
                width_m: self.size[0],
                height_m: self.size[1],
                ..WallParams::default()
            },
            motions,
            tls: Some(TlsParams {
                stations: STATIONS,
                registration_m: 4e-4,
                datum_m: 3e-4,
                spacing_m: 0.007,
                ..TlsParams::default()
            }),
            uav: None,
            ..SceneParams::default()
        }
        .seeded(seed)
    }

    fn measure(&self, seed: u64) -> Wall {
        let mut places: BTreeMap<StoneId, (SeriesPlace, Vector3<f64>)> = BTreeMap::new();
        let mut truth: BTreeMap<StoneId, Vector3<f64>> = BTreeMap::new();
        for epoch in 1..self.epochs {
            let wall = ScannedWall::later(&self.params(seed, epoch), STATIONS, epoch);
            let (found, seen) = wall.deformation();
            for stone in &found.stones {
                let shown = &seen[&stone.stone];
                let place = || SeriesPlace {
                    place: shown.centroid,
                    body: 1,
                    deformations: vec![None; self.epochs],
                };
                let (series, _) = places
                    .entry(stone.stone)
                    .or_insert_with(|| (place(), shown.normal));
                series.deformations[epoch] = Some((stone.deformation, stone.covariance));
                truth.insert(
                    stone.stone,
                    wall.truth(stone.stone, shown.centroid) / (APART * epoch as f64),
                );
            }
        }
        let (ids, shown): (Vec<StoneId>, Vec<(SeriesPlace, Vector3<f64>)>) = places.into_iter().unzip();
        let (mut stones, normals): (Vec<SeriesPlace>, Vec<Vector3<f64>>) = shown.into_iter().unzip();
        keep_congruent(&mut stones);
        let faces: Vec<_> = normals
            .iter()
            .map(|n| FaceFrame::from_normal(n).face_from_world())
            .collect();
        let one = |i: usize| {
            let look = |found: &Option<(Vector3<f64>, nalgebra::Matrix3<f64>)>| {
                let (deformation, covariance) = (*found)?;
                Some(PairLook {
                    value: faces[i] * deformation,
                    variance: (faces[i] * covariance * faces[i].transpose()).diagonal(),
                    reference_share: 0.5,
                })
            };
            let pairs: Vec<Option<PairLook>> = stones[i].deformations.iter().map(look).collect();
            StoneSeries::of_pairs(ids[i], 0, &pairs)
        };
        let series: Vec<StoneSeries> = (0..ids.len()).map(one).collect();
        let epoch = |k: usize| SeriesEpoch {
            name: (k + 1).to_string(),
            years: Some(APART * k as f64),
            ..SeriesEpoch::default()
        };
        let epochs: Vec<SeriesEpoch> = (0..self.epochs).map(epoch).collect();
        let found = analyse(&epochs, &series);
        // A step is no velocity; its zone is left out of the errors.
        let is_still = |id: &StoneId| self.step_m == 0.0 || truth[id].norm() < 1e-6;
        let stone = |s: &stonewise_core::series::StoneTrend| {
            let i = ids.iter().position(|id| *id == s.stone).unwrap();
            [s.velocity.value - faces[i] * truth[&s.stone], s.velocity.sd]
        };
        let creeping = ids
            .iter()
            .filter(|id| truth[id].norm() > 0.5 * self.creep_m && self.creep_m > 0.0);
        let creeping: Vec<&StoneId> = creeping.collect();
        let named = creeping
            .iter()
            .filter(|id| found.answers.trend.stones.contains(&id.0))
            .count();
        Wall {
            stones: found
                .stones
                .iter()
                .filter(|s| is_still(&s.stone))
                .map(stone)
                .collect(),
            creeping: [creeping.len(), named],
            answers: found.answers,
        }
    }
}

fn cells(creep: &str, walls: &[Wall], seconds: f64) -> Vec<String> {
    let percent = |n: usize, of: usize| format!("{:.1} %", 100.0 * n as f64 / of.max(1) as f64);
    let claimed = |is: &dyn Fn(&SeriesAnswers) -> bool| {
        percent(walls.iter().filter(|w| is(&w.answers)).count(), walls.len())
    };
    let stones: Vec<&[Vector3<f64>; 2]> = walls.iter().flat_map(|w| &w.stones).collect();
    let held = |axis: usize| coverage(&stones, axis);
    let of_axes = |part: usize| rms_of_axes(&stones, part);
    let [creeping, named] = [0, 1].map(|k| walls.iter().map(|w| w.creeping[k]).sum::<usize>());
    vec![
        creep.to_owned(),
        walls.len().to_string(),
        held(0),
        held(1),
        held(2),
        of_axes(0),
        of_axes(1),
        claimed(&|a| a.trend.answer == Word::Yes),
        claimed(&|a| a.anomaly.answer == Word::Yes),
        claimed(&|a| a.as_predicted.answer == Word::No),
        claimed(&|a| a.as_in_the_past.answer == Word::No),
        percent(named, creeping),
        format!("{seconds:.0}"),
    ]
}
