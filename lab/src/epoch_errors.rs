//! Measures what the sources of two epochs and stable areas show of the epochs' common error, against the
//! truth.
//!
//! `cargo run --release -p stonewise-lab -- epoch-errors FOLDER [tls|uav] [stable]`, FOLDER with
//! `truth/epochN_cloud_SENSOR_truth.laz` (stone_id, point_source_id, gps_time) and `truth/stones.csv`.

use crate::Outcome;
use crate::figures::{Z95, chi_square, share};
use crate::survey::{LEAST_POINTS, Points, SurveyPoint, pairs, places, read_points, read_stones, seen_stone};
use crate::table::Table;
use crate::words::Words;
use nalgebra::{Matrix3, Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use stonewise_core::cloud::Cloud;
use stonewise_core::progress::Silent;
use stonewise_core::registration::observers::{
    EpochErrorParams, EpochPair, SeenStone, Source, StablePoints, epoch_errors,
};
use stonewise_core::registration::{AdjustmentParams, MemoryPairs, adjust};

pub fn run(words: &Words) -> Outcome {
    let folder = words.as_slice().first().ok_or("name the FOLDER of a survey")?;
    let folder = Path::new(folder).join("truth");
    let sensor = if words.has("uav") { "uav" } else { "tls" };
    let epochs = [1, 2].map(|n| read_points(&folder.join(format!("epoch{n}_cloud_{sensor}_truth.laz"))));
    let truth = read_stones(&folder.join("stones.csv"), &[sensor]);
    let is_seen = |id: &u32| {
        let has_points = |e: &Points| e.get(id).is_some_and(|p| p.len() >= LEAST_POINTS);
        epochs.iter().all(has_points)
    };
    let ids: Vec<u32> = truth.keys().copied().filter(is_seen).collect();
    let sources = Sources::of(&epochs);
    let stones: Vec<SeenStone> = ids
        .iter()
        .filter_map(|id| seen_stone(&epochs, *id, &truth[id].normal, |e, s| sources.number(e, s)))
        .collect();
    let stable = match words.has("stable") {
        true => stable(&epochs, &sources),
        false => Vec::new(),
    };
    let own = epochs.each_ref().map(|e| places(e, &ids));
    let pairs = MemoryPairs::new(pairs(&own, |id| Some(truth[&id].normal), 0.0));
    let report = adjust(&pairs, &AdjustmentParams::default(), &Silent)?;
    println!("sigma {:?}", report.sigma_m);

    let started = std::time::Instant::now();
    let pair = EpochPair {
        stable: &stable,
        ..EpochPair::new(&sources.list, &stones, report.sigma_m[0].max(report.sigma_m[1]))
    };
    let found = epoch_errors(&pair, &EpochErrorParams::default(), &Silent)?;
    println!("{:?} in {:.1} s", found.datum, started.elapsed().as_secs_f64());
    println!(
        "{:#?} significance {:.1} observations {:?}\nstretch {:?}\n",
        found.components, found.significance, found.observations, found.stretch
    );
    let table = Table::begin(["source", "against its epoch, mm", "sd"]);
    for s in &found.sources {
        table.row([s.name.clone(), text(&s.against_epoch), text(&s.sd)]);
    }

    let errors: Vec<StoneError> = report
        .results
        .iter()
        .enumerate()
        .filter_map(|(k, result)| {
            let motion = result.motion.as_ref().ok()?;
            let truth = truth.get(&result.first.0).filter(|t| t.countable)?;
            let own = motion.covariance.fixed_view::<3, 3>(0, 0);
            Some(StoneError {
                error: motion.displacement - truth.displacement,
                predicted: found.at[k].mean,
                covariance: own + found.at[k].covariance,
            })
        })
        .collect();
    print(&errors);
    Ok(())
}

/// A stone's error, what the sources predict of it, and how sure that is.
struct StoneError {
    error: Vector3<f64>,
    predicted: Vector3<f64>,
    covariance: Matrix3<f64>,
}

impl StoneError {
    fn left(&self) -> Vector3<f64> {
        self.error - self.predicted
    }
}

/// The errors before and after the correction, x / y / z of the world.
fn print(errors: &[StoneError]) {
    let rms = |of: &dyn Fn(&StoneError) -> Vector3<f64>| {
        let squares = errors.iter().map(|e| of(e).component_mul(&of(e)));
        (squares.sum::<Vector3<f64>>() / errors.len() as f64).map(f64::sqrt)
    };
    let coverage = [0, 1, 2].map(|axis| {
        let holds = |e: &StoneError| e.left()[axis].abs() < Z95 * e.covariance[(axis, axis)].sqrt();
        format!("{:.2}", share(errors.len(), |k| holds(&errors[k])))
    });
    let squares = errors.iter().map(|e| chi_square(&e.left(), &e.covariance));
    println!();
    let table = Table::begin(["stones", "rms before, mm", "after", "coverage", "chi-square"]);
    table.row([
        errors.len().to_string(),
        text(&rms(&|e| e.error)),
        text(&rms(&StoneError::left)),
        coverage.join(" / "),
        format!("{:.1}", squares.sum::<f64>() / errors.len() as f64),
    ]);
}

/// The sources of both epochs.
struct Sources {
    list: Vec<Source>,
    numbers: BTreeMap<(usize, usize), usize>,
}

impl Sources {
    fn of(epochs: &[Points; 2]) -> Self {
        let seen: BTreeSet<(usize, usize)> = epochs
            .iter()
            .enumerate()
            .flat_map(|(epoch, e)| e.values().flatten().map(move |p| (epoch, p.source)))
            .collect();
        let source = |(epoch, number): &(usize, usize)| Source {
            name: format!("{epoch}/{number}"),
            epoch: *epoch,
            has_times: true,
            same_as: None,
        };
        Self {
            list: seen.iter().map(source).collect(),
            numbers: seen.into_iter().zip(0..).collect(),
        }
    }

    fn number(&self, epoch: usize, source: usize) -> usize {
        self.numbers[&(epoch, source)]
    }
}

fn stable(epochs: &[Points; 2], sources: &Sources) -> Vec<StablePoints> {
    let mut parts: BTreeMap<usize, Vec<&SurveyPoint>> = BTreeMap::new();
    for (epoch, points) in epochs.iter().enumerate() {
        for p in points
            .get(&0)
            .into_iter()
            .flatten()
            .filter(|p| is_stable(&p.place))
        {
            parts.entry(sources.number(epoch, p.source)).or_default().push(p);
        }
    }
    let part = |(source, points): (usize, Vec<&SurveyPoint>)| StablePoints {
        area: 0,
        source,
        points: Cloud::from_world(Point3::origin(), points.iter().map(|p| p.place)),
        times_s: points.iter().map(|p| p.time_s).collect(),
    };
    parts.into_iter().map(part).collect()
}

/// The ground and the small building in front of the wall.
fn is_stable(p: &Point3<f64>) -> bool {
    p.x > 0.35 && p.z < 2.6
}

/// Millimetres.
fn text(v: &Vector3<f64>) -> String {
    let v = 1e3 * v;
    format!("{:.2} / {:.2} / {:.2}", v.x, v.y, v.z)
}
