//! Measures what is said of series of scanned walls: errors and intervals of velocities and of what level and season
//! do, steps that are found, and what is claimed of walls on which nothing happens.
//!
//! `cargo run --release -p stonewise-lab -- series [WORD ...]`. Words: `walls=N` (of a row, default 20), `first=N` (seed of
//! the first wall), `epochs=N` (default 6), `apart=YEARS` (0.5), `creep=0,2` (of the middle of a bulge of 1.2 m, mm a
//! year), `step=MM` (a settlement of the right sixth before the fourth epoch, default 0), `level=MM` (of the middle of a
//! bulge of 0.9 m on the left, for each metre of level, 0), `season=MM` (amplitude of one on the right, largest at the end
//! of August, 0), `levels=FILE` (readings of a reservoir as in a project's `[conditions]`; without it the level goes up and
//! down by rule), `from=DATE` (of the first epoch, 2019-04-10), `size=3x2` (of the wall, m). Every wall has stones,
//! stations and errors of its own in each epoch; each later epoch is adjusted against the first with true labels.
//!
//! Columns: coverage of the 95 % intervals of velocities along, up and out; root mean square of their errors and
//! standard deviations, mm a year, and of the errors of straight lines through the motions of pairs; the same of the
//! mean of the creeping zone, by the model and by pairs; coverage of the coefficients of level and season in the three
//! directions together, and the walls whose model has the terms; coverage of the differences from the epoch before (of
//! deformations, all three components together); walls of which a trend, an anomaly, either of them, a newest epoch
//! that is not as predicted or not as in the past is claimed; share of stones that creep by more than half of the bulge
//! and are named; share of stones that stepped by more than half and are named with the right epoch; the share of the
//! true motions that the deformations of each later epoch show; deformations within their 95 % ellipsoid, of stones
//! that stood still and of those that moved.

use crate::Outcome;
use crate::figures::{CHI2_3_95, chi_square, coverage, rms_of_axes};
use crate::survey::ScannedWall;
use crate::table::Table;
use crate::words::Words;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use std::path::Path;
use stonewise::project::{ConditionsFile, DAYS_A_YEAR, day_of};
use stonewise::results::calendar::civil_from_days;
use stonewise_core::geometry::FaceFrame;
use stonewise_core::id::StoneId;
use stonewise_core::series::{
    PairLook, SeriesAnswers, SeriesEpoch, SeriesPlace, StoneSeries, StoneTrend, Term, Word, analyse,
    covariance_between, keep_congruent,
};
use stonewise_simulate::{SceneParams, TlsParams, WallMotion, WallParams};

/// The first epoch after the step.
const STEP_EPOCH: usize = 3;
const STATIONS: u32 = 2;
/// The part of the year at which the season's motion is largest.
const SEASON_AT: f64 = 0.66;
/// The part of a pair's variance that the reference brings in: both epochs are scanned alike.
const SHARE: f64 = 0.5;

pub fn run(words: &Words) -> Outcome {
    let walls: u64 = words.number("walls=").unwrap_or(20);
    let first: u64 = words.number("first=").unwrap_or(1);
    let table = Table::begin([
        "creep mm/a",
        "walls",
        "held along",
        "up",
        "out",
        "error mm/a",
        "sd mm/a",
        "by pairs mm/a",
        "zone mm/a",
        "by pairs mm/a",
        "level held",
        "entered",
        "season held",
        "entered",
        "differences held",
        "trend",
        "anomaly",
        "either",
        "not predicted",
        "not past",
        "named",
        "steps named",
        "shown of motion",
        "held still / moved",
        "s",
    ]);
    for creep in words.list("creep=", "0,2") {
        let case = Case::new(words, creep.parse::<f64>().unwrap() / 1e3);
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
    epochs: Vec<SeriesEpoch>,
    size: [f64; 2],
    creep_m: f64,
    step_m: f64,
    level_m: f64,
    season_m: f64,
}

/// Errors and their standard deviations, along, up and out.
type Errors = Vec<[Vector3<f64>; 2]>;

/// A stone with its normal, its true displacement in each epoch, and that which the pair measured.
type Shown = (SeriesPlace, Vector3<f64>, [Vec<Vector3<f64>>; 2]);

/// What was found of a wall.
struct Wall {
    /// Errors of velocities, metres a year.
    velocities: Errors,
    /// Errors of the straight line through the motions of pairs, each by itself.
    by_pairs: Vec<Vector3<f64>>,
    /// Mean errors of the creeping zone, of both.
    zone: [Vec<Vector3<f64>>; 2],
    /// Errors of what the level does, and of what the season does; empty where the term did not enter.
    level: Errors,
    season: Errors,
    /// Differences from the epoch before that lie within their 95 % ellipsoid, and all.
    differences: [usize; 2],
    answers: SeriesAnswers,
    terms: Vec<Term>,
    /// Stones that creep by more than half of the bulge, and those of them that are named.
    creeping: [usize; 2],
    /// Stones that stepped by more than half of the settlement, and those of them whose step is found in the right
    /// epoch.
    stepped: [usize; 2],
    /// Sums of each later epoch over the stones: of deformation times true motion, and of the latter squared.
    shown: Vec<[f64; 2]>,
    /// Deformations within their 95 % ellipsoid, and all: of stones that moved by less than a tenth of a millimetre, and
    /// of the others.
    held: [[usize; 2]; 2],
}

impl Case {
    fn new(words: &Words, creep_m: f64) -> Self {
        let size = words.after("size=").unwrap_or("3x2");
        let size: Vec<f64> = size.split('x').map(|s| s.parse().unwrap()).collect();
        let number = |prefix: &str| words.number::<f64>(prefix).unwrap_or(0.0);
        let apart: f64 = words.number("apart=").unwrap_or(0.5);
        let start = day_of(words.after("from=").unwrap_or("2019-04-10")).unwrap();
        let levels = words
            .after("levels=")
            .map(|path| ConditionsFile::read(Path::new(path), 30.0).unwrap());
        let epoch = |k: usize| {
            let day = start + (k as f64 * apart * DAYS_A_YEAR).round();
            let level = match &levels {
                Some(file) => {
                    let (year, month, day) = civil_from_days(day as i64);
                    file.at(&format!("{year:04}-{month:02}-{day:02}")).values["reservoir_level_m"]
                }
                None => 300.0 + [0.0, 3.0, 1.0, 4.0, 2.5, 0.5, 3.5, 1.5][k % 8],
            };
            SeriesEpoch {
                name: (k + 1).to_string(),
                years: Some(day / DAYS_A_YEAR),
                of_year: (day / DAYS_A_YEAR).rem_euclid(1.0),
                level: Some(level),
                temperature: None,
            }
        };
        Self {
            epochs: (0..words.number("epochs=").unwrap_or(6)).map(epoch).collect(),
            size: [size[0], size[1]],
            creep_m,
            step_m: number("step=") / 1e3,
            level_m: number("level=") / 1e3,
            season_m: number("season=") / 1e3,
        }
    }

    fn years(&self, epoch: usize) -> f64 {
        let of = |e: usize| self.epochs[e].years.unwrap_or(0.0);
        of(epoch) - of(0)
    }

    fn params(&self, seed: u64, epoch: usize) -> SceneParams {
        let [width, height] = self.size;
        let between = |of: &dyn Fn(&SeriesEpoch) -> f64| of(&self.epochs[epoch]) - of(&self.epochs[0]);
        let metres = between(&|e| e.level.unwrap_or(0.0));
        let wave = between(&|e| (TAU * (e.of_year - SEASON_AT)).cos());
        let bulge = |at: [f64; 2], depth_m: f64, diameter_m: f64| WallMotion::Bulge {
            centre_m: [at[0] * width, at[1] * height],
            depth_m,
            diameter_m,
        };
        let mut motions = vec![
            bulge([0.07, 0.5], self.creep_m * self.years(epoch), 1.2),
            bulge([-0.33, 0.6], self.level_m * metres, 0.9),
            bulge([0.33, 0.4], self.season_m * wave, 0.9),
        ];
        motions.retain(|m| !matches!(m, WallMotion::Bulge { depth_m, .. } if *depth_m == 0.0));
        if self.step_m != 0.0 && epoch >= STEP_EPOCH {
            motions.push(WallMotion::Settlement {
                from_m: width / 6.0,
                to_m: width / 6.0 + 0.1,
                depth_m: self.step_m,
            });
        }
        SceneParams {
            wall: WallParams {
                width_m: width,
                height_m: height,
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

    /// What every stone truly did for each unit of the trend, the level, the waves of the season and the step, from
    /// its true places in all epochs, which these make up.
    fn coefficients(&self, truth: &[Vector3<f64>]) -> [Vector3<f64>; 5] {
        let rows = self.epochs.len();
        let first = &self.epochs[0];
        let columns = |k: usize| {
            let epoch = &self.epochs[k];
            let wave = |f: fn(f64) -> f64| f(TAU * epoch.of_year) - f(TAU * first.of_year);
            let level = epoch.level.unwrap_or(0.0) - first.level.unwrap_or(0.0);
            let step = f64::from(u8::from(self.step_m != 0.0 && k >= STEP_EPOCH));
            [self.years(k), level, wave(f64::cos), wave(f64::sin), step]
        };
        let used: Vec<usize> = [
            self.creep_m != 0.0,
            self.level_m != 0.0,
            self.season_m != 0.0,
            self.season_m != 0.0,
            self.step_m != 0.0,
        ]
        .iter()
        .enumerate()
        .filter_map(|(c, used)| used.then_some(c))
        .collect();
        let mut found = [Vector3::zeros(); 5];
        if used.is_empty() {
            return found;
        }
        let design = DMatrix::from_fn(rows, used.len(), |r, c| columns(r)[used[c]]);
        let svd = design.svd(true, true);
        for axis in 0..3 {
            let values = DVector::from_fn(rows, |r, _| truth[r][axis]);
            let solved = svd.solve(&values, 1e-9).unwrap();
            used.iter()
                .enumerate()
                .for_each(|(c, &term)| found[term][axis] = solved[c]);
        }
        found
    }

    fn measure(&self, seed: u64) -> Wall {
        let count = self.epochs.len();
        let mut places: BTreeMap<StoneId, Shown> = BTreeMap::new();
        let mut zones: Vec<BTreeSet<StoneId>> = Vec::new();
        for epoch in 1..count {
            let wall = ScannedWall::later(&self.params(seed, epoch), STATIONS, epoch);
            let (found, seen) = wall.deformation();
            zones.extend(found.zones.iter().map(|z| z.stones.iter().copied().collect()));
            let motions = wall
                .report
                .results
                .iter()
                .filter_map(|r| Some((r.first, r.motion.as_ref().ok()?)));
            let motions: BTreeMap<StoneId, Vector3<f64>> =
                motions.map(|(id, m)| (id, m.displacement)).collect();
            for stone in &found.stones {
                let shown = &seen[&stone.stone];
                let new = || {
                    let place = SeriesPlace {
                        place: shown.centroid,
                        deformations: vec![None; count],
                    };
                    let none = || vec![Vector3::zeros(); count];
                    (place, shown.normal, [none(), none()])
                };
                let (series, _, [truth, pair]) = places.entry(stone.stone).or_insert_with(new);
                series.deformations[epoch] = Some((stone.deformation, stone.covariance));
                truth[epoch] = wall.truth(stone.stone, shown.centroid);
                pair[epoch] = motions[&stone.stone];
            }
        }
        let ids: Vec<StoneId> = places.keys().copied().collect();
        let (mut stones, mut normals) = (Vec::new(), Vec::new());
        let (mut truths, mut pairs) = (Vec::new(), Vec::new());
        for (place, normal, [truth, pair]) in places.into_values() {
            stones.push(place);
            normals.push(normal);
            truths.push(truth);
            pairs.push(pair);
        }
        keep_congruent(&mut stones);
        let faces: Vec<Matrix3<f64>> = normals
            .iter()
            .map(|n| FaceFrame::from_normal(n).face_from_world())
            .collect();
        let one = |i: usize| {
            let look = |found: &Option<(Vector3<f64>, Matrix3<f64>)>| {
                let (deformation, covariance) = (*found)?;
                Some(PairLook {
                    value: faces[i] * deformation,
                    variance: (faces[i] * covariance * faces[i].transpose()).diagonal(),
                    reference_share: SHARE,
                })
            };
            let pairs: Vec<Option<PairLook>> = stones[i].deformations.iter().map(look).collect();
            StoneSeries::of_pairs(ids[i], 0, &pairs)
        };
        let series: Vec<StoneSeries> = (0..ids.len()).map(one).collect();
        let found = analyse(&self.epochs, &series, &zones);
        let place_of: BTreeMap<StoneId, usize> = ids.iter().copied().zip(0..).collect();
        // Where an epoch misses a stone its true place is not known here, and the stone is left out.
        let whole = |i: usize| stones[i].deformations[1..].iter().all(Option::is_some);
        let truth: Vec<Option<[Vector3<f64>; 5]>> = (0..ids.len())
            .map(|i| whole(i).then(|| self.coefficients(&truths[i]).map(|c| faces[i] * c)))
            .collect();
        let mut wall = Wall {
            velocities: Vec::new(),
            by_pairs: Vec::new(),
            zone: [Vec::new(), Vec::new()],
            level: Vec::new(),
            season: Vec::new(),
            differences: differences(&stones, &truths),
            terms: found.terms().to_vec(),
            answers: found.answers,
            creeping: [0; 2],
            stepped: [0; 2],
            shown: shown(&stones, &truths),
            held: held(&stones, &truths),
        };
        let mut of_zone = Vec::new();
        for stone in &found.stones {
            let i = place_of[&stone.stone];
            let Some(truth) = &truth[i] else {
                continue;
            };
            self.score(stone, truth, &mut wall);
            let by_pairs = faces[i] * self.slope(&pairs[i]) - truth[0];
            wall.by_pairs.push(by_pairs);
            if self.creep_m > 0.0 && truth[0].norm() > 0.5 * self.creep_m {
                of_zone.push([stone.velocity.value - truth[0], by_pairs]);
            }
        }
        if !of_zone.is_empty() {
            let mean = |k: usize| of_zone.iter().map(|e| e[k]).sum::<Vector3<f64>>() / of_zone.len() as f64;
            [0, 1].iter().for_each(|&k| wall.zone[k].push(mean(k)));
        }
        wall
    }

    /// The slope of the straight line through the motions of all pairs, which count as independent and alike.
    fn slope(&self, motions: &[Vector3<f64>]) -> Vector3<f64> {
        let years: Vec<f64> = (1..motions.len()).map(|k| self.years(k)).collect();
        let mean = years.iter().sum::<f64>() / years.len() as f64;
        let square: f64 = years.iter().map(|y| (y - mean).powi(2)).sum();
        let sum = years.iter().zip(&motions[1..]).map(|(y, d)| d * (y - mean));
        sum.sum::<Vector3<f64>>() / square
    }

    fn score(&self, stone: &StoneTrend, truth: &[Vector3<f64>; 5], wall: &mut Wall) {
        let [velocity, level, cos, sin, step] = *truth;
        wall.velocities
            .push([stone.velocity.value - velocity, stone.velocity.sd]);
        if let Some(found) = &stone.level {
            wall.level.push([found.value - level, found.sd]);
        }
        if let Some([of_cos, of_sin]) = &stone.season {
            wall.season.push([of_cos.value - cos, of_cos.sd]);
            wall.season.push([of_sin.value - sin, of_sin.sd]);
        }
        let named = |list: &[u32]| usize::from(list.contains(&stone.stone.0));
        if self.creep_m > 0.0 && velocity.norm() > 0.5 * self.creep_m {
            wall.creeping[0] += 1;
            wall.creeping[1] += named(&wall.answers.trend.stones);
        }
        if self.step_m != 0.0 && step.norm() > 0.5 * self.step_m.abs() {
            wall.stepped[0] += 1;
            let at = stone.step.is_some_and(|s| s.epoch == STEP_EPOCH);
            wall.stepped[1] += usize::from(at);
        }
    }
}

/// How much of the true motions the deformations show, of each later epoch.
fn shown(stones: &[SeriesPlace], truths: &[Vec<Vector3<f64>>]) -> Vec<[f64; 2]> {
    let epochs = truths.first().map_or(0, Vec::len);
    let of_epoch = |k: usize| {
        let mut sums = [0.0; 2];
        for (stone, truth) in stones.iter().zip(truths) {
            if let Some((found, _)) = &stone.deformations[k] {
                sums[0] += found.dot(&truth[k]);
                sums[1] += truth[k].norm_squared();
            }
        }
        sums
    };
    (1..epochs).map(of_epoch).collect()
}

/// Deformations within their 95 % ellipsoid, and all, of still stones and of others.
fn held(stones: &[SeriesPlace], truths: &[Vec<Vector3<f64>>]) -> [[usize; 2]; 2] {
    let mut counted = [[0; 2]; 2];
    for (stone, truth) in stones.iter().zip(truths) {
        for (k, found) in stone.deformations.iter().enumerate() {
            let Some((found, covariance)) = found else {
                continue;
            };
            let counted = &mut counted[usize::from(truth[k].norm() > 1e-4)];
            counted[0] += usize::from(chi_square(&(found - truth[k]), covariance) <= CHI2_3_95);
            counted[1] += 1;
        }
    }
    counted
}

/// Differences of deformations from the epoch before within their 95 % ellipsoid, and all.
fn differences(stones: &[SeriesPlace], truths: &[Vec<Vector3<f64>>]) -> [usize; 2] {
    let mut counted = [0; 2];
    for (stone, truth) in stones.iter().zip(truths) {
        for k in 2..stone.deformations.len() {
            let (Some(before), Some(after)) = (&stone.deformations[k - 1], &stone.deformations[k]) else {
                continue;
            };
            let error = (after.0 - before.0) - (truth[k] - truth[k - 1]);
            let covariance = covariance_between((&after.1, SHARE), (&before.1, SHARE));
            counted[0] += usize::from(chi_square(&error, &covariance) <= CHI2_3_95);
            counted[1] += 1;
        }
    }
    counted
}

/// Root mean squares along, up and out, millimetres.
fn rms<'a>(errors: impl Iterator<Item = &'a Vector3<f64>>) -> String {
    let pairs: Vec<[Vector3<f64>; 2]> = errors.map(|e| [*e, Vector3::zeros()]).collect();
    match pairs.is_empty() {
        true => "\u{2013}".to_owned(),
        false => rms_of_axes(&pairs.iter().collect::<Vec<_>>(), 0),
    }
}

fn swapped([n, of]: [usize; 2]) -> [usize; 2] {
    [of, n]
}

/// The share of the motions that each epoch shows.
fn shares(walls: &[Wall]) -> String {
    let epochs = walls.first().map_or(0, |w| w.shown.len());
    let of_epoch = |k: usize| {
        let sum = |i: usize| walls.iter().map(|w| w.shown[k][i]).sum::<f64>();
        match sum(1) > 0.0 {
            true => format!("{:.2}", sum(0) / sum(1)),
            false => "\u{2013}".to_owned(),
        }
    };
    (0..epochs).map(of_epoch).collect::<Vec<_>>().join(" ")
}

fn cells(creep: &str, walls: &[Wall], seconds: f64) -> Vec<String> {
    let percent = |n: usize, of: usize| match of {
        0 => "\u{2013}".to_owned(),
        _ => format!("{:.1} %", 100.0 * n as f64 / of as f64),
    };
    let of_walls = |is: &dyn Fn(&Wall) -> bool| percent(walls.iter().filter(|w| is(w)).count(), walls.len());
    let claimed = |is: &dyn Fn(&SeriesAnswers) -> bool| of_walls(&|w| is(&w.answers));
    let velocities: Vec<&[Vector3<f64>; 2]> = walls.iter().flat_map(|w| &w.velocities).collect();
    let held = |errors: Vec<&[Vector3<f64>; 2]>| match errors.is_empty() {
        true => "\u{2013}".to_owned(),
        false => [0, 1, 2].map(|axis| coverage(&errors, axis)).join(" / "),
    };
    let sum =
        |of: &dyn Fn(&Wall) -> [usize; 2]| [0, 1].map(|k| walls.iter().map(|w| of(w)[k]).sum::<usize>());
    let share = |[of, n]: [usize; 2]| percent(n, of);
    let [within, all] = sum(&|w| w.differences);
    let trend = |a: &SeriesAnswers| a.trend.answer == Word::Yes;
    let anomaly = |a: &SeriesAnswers| a.anomaly.answer == Word::Yes;
    vec![
        creep.to_owned(),
        walls.len().to_string(),
        coverage(&velocities, 0),
        coverage(&velocities, 1),
        coverage(&velocities, 2),
        rms_of_axes(&velocities, 0),
        rms_of_axes(&velocities, 1),
        rms(walls.iter().flat_map(|w| &w.by_pairs)),
        rms(walls.iter().flat_map(|w| &w.zone[0])),
        rms(walls.iter().flat_map(|w| &w.zone[1])),
        held(walls.iter().flat_map(|w| &w.level).collect()),
        of_walls(&|w| w.terms.contains(&Term::Level)),
        held(walls.iter().flat_map(|w| &w.season).collect()),
        of_walls(&|w| w.terms.contains(&Term::Season)),
        percent(within, all),
        claimed(&trend),
        claimed(&anomaly),
        claimed(&|a| trend(a) || anomaly(a)),
        claimed(&|a| a.as_predicted.answer == Word::No),
        claimed(&|a| a.as_in_the_past.answer == Word::No),
        share(sum(&|w| w.creeping)),
        share(sum(&|w| w.stepped)),
        shares(walls),
        [0, 1]
            .map(|moved| share(swapped(sum(&|w| w.held[moved]))))
            .join(" / "),
        format!("{seconds:.0}"),
    ]
}
