//! The motion of stones between two labelled clouds that lie in memory.

use crate::arrays::points;
use crate::attended::{Listeners, attended};
use crate::clouds::Tiled;
use crate::command::parameters_of;
use crate::error::{error, explained};
use nalgebra::{Isometry3, Matrix3, Point2, Point3};
use numpy::{IntoPyArray, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::{BTreeMap, BTreeSet, HashSet};
use stonewise::Settings;
use stonewise::results::{Reference, StoneRow, Term, stone_table};
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::geometry::{Camera, Plane, View, cell_of, cells_around};
use stonewise_core::id::{ImageId, StoneId};
use stonewise_core::matching::{Footprints, MatchReport, Surroundings, footprint_overlap, match_stones};
use stonewise_core::progress::{Interrupted, Progress};
use stonewise_core::registration::observers::{
    EpochErrorParams, EpochPair, SeenStone, Source, SourcePoints, epoch_errors,
};
use stonewise_core::registration::{
    AdjustmentReport, MatchedPair, MemoryPairs, adjust as adjust_pairs, choose_points,
};
use stonewise_core::stone::{MatchOutcome, PairResult, Stone, common_motion};
use stonewise_core::transfer::{LabelStore, MemoryLabels, TileLabels, build_stones};
use stonewise_io::table::{Column, Table};

/// Edge of the cells of coverage, metres, as in the step `match` of a run.
const COVERAGE_CELL_M: f64 = 0.1;
/// Where a viewpoint is put that the caller does not give, metres in front of the wall.
const FAR_M: f64 = 1e4;
/// Points on which the wall's plane is fitted, for such a viewpoint.
const PLANE_POINTS: usize = 20_000;

/// Columns of the stone table that this function has no photos or no facade to fill.
const WITHOUT: [&str; 4] = ["photos", "confidence", "along_m", "up_m"];

/// The stone table of two labelled clouds, `{name: (values, is_filled)}`, and what the adjustment says about
/// itself.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn adjust<'py>(
    py: Python<'py>,
    points_1: PyReadonlyArray2<'py, f64>,
    labels_1: PyReadonlyArray1<'py, u32>,
    points_2: PyReadonlyArray2<'py, f64>,
    labels_2: PyReadonlyArray1<'py, u32>,
    viewpoints: Option<PyReadonlyArray2<'py, f64>>,
    parameters: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>)> {
    let settings = Settings::default()
        .with_parameters(&parameters_of(parameters)?)
        .map_err(explained)?;
    let clouds = [points(&points_1)?, points(&points_2)?];
    let labels = [&labels_1, &labels_2].map(|l| l.as_array().to_vec());
    for (cloud, labels) in clouds.iter().zip(&labels) {
        if cloud.len() != labels.len() {
            let message = format!("{} points and {} labels", cloud.len(), labels.len());
            return Err(error(message));
        }
    }
    let viewpoints = viewpoints.as_ref().map(points).transpose()?;
    let found = attended(py, &Listeners::progress(progress), |progress| {
        let viewpoints = viewpoints.unwrap_or_else(|| in_front(&clouds[0], &labels[0]));
        measure(&clouds, &labels, &viewpoints, &settings, progress)
    })?;
    let (table, report) = found.map_err(explained)?;
    Ok((columns(py, &table)?, summary(py, &report)?))
}

/// An epoch in memory.
struct Epoch {
    tiled: Tiled,
    labels: MemoryLabels,
    stones: Vec<Stone>,
}

type Measured = (Table, AdjustmentReport);

fn measure(
    clouds: &[Vec<Point3<f64>>; 2],
    labels: &[Vec<u32>; 2],
    viewpoints: &[Point3<f64>],
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Measured, stonewise::Error> {
    let first = Epoch::new(&clouds[0], &labels[0], viewpoints, settings, progress)?;
    let second = Epoch::new(&clouds[1], &labels[1], viewpoints, settings, progress)?;
    let matched = first.matched(&second, settings);
    let pairs = gather(&first, &second, &matched, settings.registration.border_noises);
    progress.check()?;
    let adjusted = adjust_pairs(&pairs, &settings.registration.adjustment, progress);
    let mut report = adjusted.map_err(|e| match e {
        stonewise_core::registration::AdjustError::Interrupted(_) => stonewise::Error::Interrupted,
        e => stonewise::Error::Registration(e.to_string()),
    })?;
    report.results.sort_by_key(|r| r.first);
    let relative = relative_errors(&first, &report, &settings.registration.observers, progress)?;
    Ok((
        stone_table(&rows(&first, &second, &matched, &report.results, &relative))?,
        report,
    ))
}

impl Epoch {
    fn new(
        points: &[Point3<f64>],
        labels: &[u32],
        viewpoints: &[Point3<f64>],
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Self, stonewise::Error> {
        let tiled = Tiled::new(points, settings.ingest.size_m);
        let mut store = MemoryLabels::default();
        for (tile, stone) in tiled.split(labels).into_iter().enumerate() {
            let count = stone.len();
            let labels = TileLabels {
                stone,
                confidence: vec![1.0; count],
                seen: vec![true; count],
            };
            let Ok(()) = store.write(tile, &labels);
        }
        let views: Vec<View> = viewpoints.iter().zip(0..).map(|(p, n)| view_from(p, n)).collect();
        let stones = build_stones(&tiled.tiles, &store, &views, &[], &settings.stones, progress)?;
        Ok(Self {
            tiled,
            labels: store,
            stones: handed_over(&stones)?,
        })
    }

    /// Every point with its stone, in the order of the tiles.
    fn points(&self) -> impl Iterator<Item = (Point3<f64>, u32)> + Clone + '_ {
        let tiles = &self.tiled.tiles;
        (0..tiles.tile_count()).flat_map(move |tile| {
            let Ok(cloud) = tiles.load(tile);
            let labels = &self.labels.tiles[tile].stone;
            (0..cloud.len())
                .map(move |i| (cloud.world(i), labels[i]))
                .collect::<Vec<_>>()
        })
    }

    fn matched(&self, second: &Self, settings: &Settings) -> MatchReport {
        let (_, footprints) = self.coverage();
        let (covered, footprints_2) = second.coverage();
        let overlap = footprint_overlap(&footprints, &footprints_2);
        let sees = |p: &Point3<f64>| cells_around(cell_of(p, COVERAGE_CELL_M)).any(|c| covered.contains(&c));
        let surroundings = Surroundings {
            covered: &sees,
            overlap: Some(&overlap),
        };
        match_stones(&self.stones, &second.stones, &surroundings, &settings.r#match)
    }

    /// Cells with points, and where the stones lie.
    fn coverage(&self) -> (HashSet<[i64; 3]>, Footprints) {
        let (mut covered, mut footprints) = (HashSet::new(), Footprints::new());
        for (place, stone) in self.points() {
            covered.insert(cell_of(&place, COVERAGE_CELL_M));
            if stone != 0 {
                footprints.add(StoneId(stone), &place);
            }
        }
        (covered, footprints)
    }
}

/// The stones as the steps of a run hand them over, in a file: reading its numbers changes some in the last
/// bit, and one bit can decide whether a point at the border of a stone counts.
fn handed_over(stones: &[Stone]) -> Result<Vec<Stone>, stonewise::Error> {
    let failed = |e: serde_json::Error| stonewise::Error::Registration(e.to_string());
    serde_json::from_slice(&serde_json::to_vec(stones).map_err(failed)?).map_err(failed)
}

/// The points of all matched stones, in the order of a run.
fn gather(first: &Epoch, second: &Epoch, matched: &MatchReport, border_noises: f64) -> MemoryPairs {
    let partner = |(id, outcome): &(StoneId, MatchOutcome)| match outcome {
        MatchOutcome::Matched { second } => Some((*id, *second)),
        MatchOutcome::Unmatched(_) => None,
    };
    let matches: Vec<(StoneId, StoneId)> = matched.outcomes.iter().filter_map(partner).collect();
    let pairs = MatchedPair::of_matches(&first.stones, &second.stones, &matches);
    choose_points(&pairs, [first.points(), second.points()], border_noises)
}

/// Covariance of the non-rigid part of the registration error at each matched stone, m^2, as assumed for clouds
/// without stations or strips.
fn relative_errors(
    first: &Epoch,
    report: &AdjustmentReport,
    params: &EpochErrorParams,
    progress: &dyn Progress,
) -> Result<BTreeMap<StoneId, Matrix3<f64>>, Interrupted> {
    let matched: BTreeSet<StoneId> = report.results.iter().map(|r| r.first).collect();
    let stones: Vec<&Stone> = first.stones.iter().filter(|s| matched.contains(&s.id)).collect();
    let sources = [0, 1].map(|epoch| Source {
        name: String::new(),
        epoch,
        has_times: false,
        same_as: None,
    });

    let sight = |source, stone: &Stone| SourcePoints {
        source,
        count: 1,
        time_s: 0.0,
        points: Cloud::new(stone.centroid, Vec::new()),
    };

    let seen: Vec<SeenStone> = stones
        .iter()
        .map(|stone| SeenStone {
            centroid: stone.centroid,
            normal: stone.normal,
            sights: vec![sight(0, stone), sight(1, stone)],
        })
        .collect();
    let pair = EpochPair::new(&sources, &seen, report.sigma_m[0].max(report.sigma_m[1]));
    let errors = epoch_errors(&pair, params, progress)?;
    Ok(stones.iter().map(|s| s.id).zip(errors.relative).collect())
}

/// One row for each stone of the first epoch, as of a run in which nothing is known about the registration of
/// the epochs. `relative`: covariances of the non-rigid part of the registration error.
fn rows(
    first: &Epoch,
    second: &Epoch,
    matched: &MatchReport,
    results: &[PairResult],
    relative: &BTreeMap<StoneId, Matrix3<f64>>,
) -> Vec<StoneRow> {
    let partners: BTreeMap<StoneId, &Stone> = second.stones.iter().map(|s| (s.id, s)).collect();
    let outcomes: BTreeMap<StoneId, MatchOutcome> = matched.outcomes.iter().copied().collect();
    let motions: BTreeMap<StoneId, &PairResult> = results.iter().map(|r| (r.first, r)).collect();
    let common = common_motion(&first.stones, &motions);

    let row = |stone: &Stone| {
        let outcome = outcomes.get(&stone.id)?;
        let partner = match outcome {
            MatchOutcome::Matched { second } => partners.get(second).copied(),
            MatchOutcome::Unmatched(_) => None,
        };
        let relative = relative.get(&stone.id).map(|r| (Term::Registration, *r));
        let reference = Reference::against(common.as_ref(), stone, relative.into_iter().collect());
        let pair = motions.get(&stone.id).copied();
        Some(StoneRow::new(
            stone,
            outcome,
            partner,
            pair,
            &reference,
            &Point2::origin(),
        ))
    };

    first.stones.iter().filter_map(row).collect()
}

/// A photo that is nothing but a place from which the wall is seen.
fn view_from(place: &Point3<f64>, number: u32) -> View {
    View {
        image: ImageId(number),
        name: String::new(),
        camera: Camera::pinhole(1, 1, 1.0),
        cam_from_world: Isometry3::translation(-place.x, -place.y, -place.z),
    }
}

/// A place far in front of the wall, on whichever side: the normals of all stones then point to one side.
fn in_front(points: &[Point3<f64>], labels: &[u32]) -> Vec<Point3<f64>> {
    let labelled = || {
        let all = points.iter().zip(labels);
        all.filter(|(p, l)| **l != 0 && p.iter().all(|c| c.is_finite()))
            .map(|(p, _)| *p)
    };
    let stride = (labelled().count() / PLANE_POINTS).max(1);
    let sample: Vec<Point3<f64>> = labelled().step_by(stride).collect();
    let plane = Plane::fit(&sample);
    plane.map(|p| p.centroid + p.normal * FAR_M).into_iter().collect()
}

fn columns<'py>(py: Python<'py>, table: &Table) -> PyResult<Bound<'py, PyDict>> {
    let columns = PyDict::new(py);
    for (name, column) in table.columns().filter(|(name, _)| !WITHOUT.contains(name)) {
        let filled: Vec<bool> = (0..column.len()).map(|row| column.is_filled(row)).collect();
        columns.set_item(name, (values(py, column)?, filled.into_pyarray(py)))?;
    }
    Ok(columns)
}

fn values<'py>(py: Python<'py>, column: &Column) -> PyResult<Bound<'py, PyAny>> {
    if let Some(values) = column.values::<f64>() {
        return Ok(values.to_vec().into_pyarray(py).into_any());
    }
    if let Some(values) = column.values::<u32>() {
        return Ok(values.to_vec().into_pyarray(py).into_any());
    }
    if let Some(values) = column.values::<u8>() {
        return Ok(values.to_vec().into_pyarray(py).into_any());
    }
    let words: Vec<String> = column.values::<String>().unwrap_or_default().to_vec();
    Ok(words.into_pyobject(py)?.into_any())
}

fn summary<'py>(py: Python<'py>, report: &AdjustmentReport) -> PyResult<Bound<'py, PyDict>> {
    let summary = PyDict::new(py);
    let covariance = report.common_covariance;
    let covariance: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| covariance[(i, j)]));
    summary.set_item("converged", report.converged)?;
    summary.set_item("iterations", report.iterations)?;
    summary.set_item("noise_m", report.sigma_m)?;
    summary.set_item("common_motion_m", <[f64; 3]>::from(report.common_motion))?;
    summary.set_item("common_motion_covariance_m2", covariance)?;
    Ok(summary)
}
