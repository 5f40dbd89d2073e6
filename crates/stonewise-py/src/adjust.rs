//! The motion of stones between two labelled clouds that lie in memory.

use crate::arrays::points;
use crate::attended::{Listeners, attended};
use crate::clouds::Tiled;
use crate::command::parameters_of;
use crate::error::{error, explained};
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use numpy::{IntoPyArray, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;
use stonewise::Settings;
use stonewise::results::{Reference, StoneRow, stone_table};
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::geometry::{Bounds, Camera, Plane, View, cell_of};
use stonewise_core::id::{ImageId, StoneId};
use stonewise_core::matching::{Footprints, MatchReport, Surroundings, footprint_overlap, match_stones};
use stonewise_core::progress::Progress;
use stonewise_core::registration::{
    AdjustmentReport, MemoryPairs, NearPoint, PairPoints, adjust as adjust_pairs, local_shifts, stone_points,
};
use stonewise_core::stone::{MatchOutcome, PairResult, Stone, common_motion};
use stonewise_core::transfer::{LabelStore, MemoryLabels, TileLabels, build_stones};
use stonewise_io::table::{Column, Table};

/// As in the steps `match` and `register` of a run.
const COVERAGE_CELL_M: f64 = 0.1;
const NEIGHBOURHOOD_M: f64 = 4.0;
const BOX_CELL_M: f64 = 0.5;
const BOX_MARGIN_M: f64 = 0.02;
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
    let adjusted = adjust_pairs(
        &MemoryPairs::new(pairs),
        &settings.registration.adjustment,
        progress,
    );
    let mut report = adjusted.map_err(|e| match e {
        stonewise_core::registration::AdjustError::Interrupted(_) => stonewise::Error::Interrupted,
        e => stonewise::Error::Registration(e.to_string()),
    })?;
    report.results.sort_by_key(|r| r.first);
    Ok((
        stone_table(&rows(&first, &second, &matched, &report.results))?,
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
    fn points(&self) -> impl Iterator<Item = (Point3<f64>, u32)> + '_ {
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
        let sees = |p: &Point3<f64>| {
            let [x, y, z] = cell_of(p, COVERAGE_CELL_M);
            (0..27i64).any(|i| covered.contains(&[x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]))
        };
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

    fn extents(&self) -> BTreeMap<u32, Bounds> {
        let mut extents: BTreeMap<u32, Bounds> = BTreeMap::new();
        for (place, stone) in self.points().filter(|p| p.1 != 0) {
            let point = Bounds {
                min: place,
                max: place,
            };
            let extent = extents.entry(stone).or_insert(point);
            *extent = extent.union(&point);
        }
        extents
    }
}

/// The stones as the steps of a run hand them over, in a file: reading its numbers changes some in the last
/// bit, and one bit can decide whether a point at the border of a stone counts.
fn handed_over(stones: &[Stone]) -> Result<Vec<Stone>, stonewise::Error> {
    let failed = |e: serde_json::Error| stonewise::Error::Registration(e.to_string());
    serde_json::from_slice(&serde_json::to_vec(stones).map_err(failed)?).map_err(failed)
}

/// A matched stone in both epochs.
struct Pair {
    first: Stone,
    second: Stone,
    /// How the stones around it moved, metres.
    shift: Vector3<f64>,
    /// Box of its points in the first epoch, somewhat larger.
    extent: Option<Bounds>,
}

/// The points of all matched stones, in the order of a run.
fn gather(first: &Epoch, second: &Epoch, matched: &MatchReport, border_noises: f64) -> Vec<PairPoints> {
    let pairs = pairs(first, second, matched, border_noises);
    let near = [
        near_points(first, &pairs, |p| (p.first.id, Vector3::zeros())),
        near_points(second, &pairs, |p| (p.second.id, p.shift)),
    ];
    let [ones, twos] = near;
    let chosen = pairs.into_iter().zip(ones.iter().zip(&twos));
    chosen
        .map(|(pair, (one, two))| {
            let chosen = stone_points([one, two], &pair.first.normal, &pair.shift, border_noises);
            let centroid = pair.first.centroid;
            PairPoints {
                first: pair.first.id,
                second: pair.second.id,
                centroid,
                centroid_second: pair.second.centroid,
                normal: pair.first.normal,
                points_first: Cloud::new(centroid, chosen.first),
                points_second: Cloud::new(centroid, chosen.second),
                nearby_second: Cloud::new(centroid, chosen.nearby_second),
                window: chosen.window.map(Arc::new),
            }
        })
        .collect()
}

fn pairs(first: &Epoch, second: &Epoch, matched: &MatchReport, border_noises: f64) -> Vec<Pair> {
    let by_id = |stones: &[Stone]| {
        stones
            .iter()
            .map(|s| (s.id, s.clone()))
            .collect::<BTreeMap<_, _>>()
    };
    let (ones, twos) = (by_id(&first.stones), by_id(&second.stones));
    let partners = matched.outcomes.iter().filter_map(|(id, outcome)| match outcome {
        MatchOutcome::Matched { second } => Some((ones.get(id)?.clone(), twos.get(second)?.clone())),
        MatchOutcome::Unmatched(_) => None,
    });
    let found: Vec<(Stone, Stone)> = partners.collect();
    let centroids: Vec<Point3<f64>> = found.iter().map(|(a, _)| a.centroid).collect();
    let moved: Vec<Vector3<f64>> = found.iter().map(|(a, b)| b.centroid - a.centroid).collect();
    let extents = match border_noises > 0.0 {
        true => first.extents(),
        false => BTreeMap::new(),
    };
    let mut pairs: Vec<Pair> = found
        .into_iter()
        .zip(local_shifts(&centroids, &moved))
        .map(|((first, second), shift)| Pair {
            extent: extents.get(&first.id.0).map(|e| e.grown(BOX_MARGIN_M)),
            first,
            second,
            shift,
        })
        .collect();
    pairs.sort_by_key(|p| (cell_of(&p.first.centroid, NEIGHBOURHOOD_M), p.first.id));
    pairs
}

/// For each pair its labelled points, and all others in its box; `place`: the stone in this epoch, and the
/// shift of the box.
fn near_points(
    epoch: &Epoch,
    pairs: &[Pair],
    place: impl Fn(&Pair) -> (StoneId, Vector3<f64>),
) -> Vec<Vec<NearPoint>> {
    let mut near = vec![Vec::new(); pairs.len()];
    let mut of_stone: BTreeMap<u32, usize> = BTreeMap::new();
    let mut boxes: Vec<Option<Bounds>> = Vec::with_capacity(pairs.len());
    let mut cells: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (k, pair) in pairs.iter().enumerate() {
        let (stone, shift) = place(pair);
        of_stone.insert(stone.0, k);
        let bounds = pair.extent.map(|e| e.moved(&shift));
        if let Some(bounds) = &bounds {
            let (low, high) = (cell_of(&bounds.min, BOX_CELL_M), cell_of(&bounds.max, BOX_CELL_M));
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    for z in low[2]..=high[2] {
                        cells.entry([x, y, z]).or_default().push(k);
                    }
                }
            }
        }
        boxes.push(bounds);
    }
    for (point, stone) in epoch.points() {
        let own = of_stone.get(&stone).copied();
        let here = cells.get(&cell_of(&point, BOX_CELL_M)).into_iter().flatten();
        let others = here
            .copied()
            .filter(|&k| Some(k) != own && boxes[k].is_some_and(|b| b.contains(&point)));
        for k in own.into_iter().chain(others) {
            near[k].push(NearPoint {
                offset: (point - pairs[k].first.centroid).cast::<f32>().into(),
                labelled: Some(k) == own,
            });
        }
    }
    near
}

/// One row for each stone of the first epoch, as of a run in which nothing is known about the registration of
/// the epochs.
fn rows(first: &Epoch, second: &Epoch, matched: &MatchReport, results: &[PairResult]) -> Vec<StoneRow> {
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
        let reference = common
            .as_ref()
            .map_or_else(Reference::default, |common| Reference {
                motion: common.at(&stone.centroid),
                covariance: common.covariance_at(&stone.centroid),
            });
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
