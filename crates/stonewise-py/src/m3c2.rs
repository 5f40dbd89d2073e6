//! Comparison along normals.

use crate::arrays::{from_vectors, points, vectors};
use crate::attended::{Listeners, attended};
use crate::error::{error, explained};
use nalgebra::{Point3, Vector3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use stonewise_core::change::{
    ChangePoint, M3c2Params, OutwardReference, estimate_normals, m3c2 as compare, thin_to_voxels,
};
use stonewise_core::cloud::GridIndex;
use stonewise_core::params::Params;
use stonewise_core::progress::{Interrupted, Progress};

/// Core points between two looks whether to stop.
const BATCH: usize = 8192;

/// Distances, detection limits, spread and count in either epoch, normals.
type Columns<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    [Bound<'py, PyArray1<f64>>; 2],
    [Bound<'py, PyArray1<u32>>; 2],
    Bound<'py, PyArray2<f64>>,
);

/// M3C2 at core points; normals that are not given are fitted to the first cloud and point at the nearest
/// viewpoint, or along a direction.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn m3c2<'py>(
    py: Python<'py>,
    points_1: PyReadonlyArray2<'py, f64>,
    points_2: PyReadonlyArray2<'py, f64>,
    core_points: PyReadonlyArray2<'py, f64>,
    normals: Option<PyReadonlyArray2<'py, f64>>,
    viewpoints: Option<PyReadonlyArray2<'py, f64>>,
    direction: [f64; 3],
    normal_radius: f64,
    cyl_radius: f64,
    max_distance: f64,
    registration_error: f64,
    robust_aggr: bool,
    min_points: u32,
    ddof: u32,
    progress: Option<Py<PyAny>>,
) -> PyResult<Columns<'py>> {
    let params = M3c2Params {
        normal_radius_m: normal_radius,
        cylinder_radius_m: cyl_radius,
        max_depth_m: max_distance,
        registration_error_m: registration_error,
        robust: robust_aggr,
        min_points,
        ddof,
        ..M3c2Params::default()
    };
    params.check().map_err(explained)?;
    let clouds = [points(&points_1)?, points(&points_2)?];
    let core = points(&core_points)?;
    let given = normals.as_ref().map(vectors).transpose()?;
    if given.as_ref().is_some_and(|n| n.len() != core.len()) {
        return Err(error("corepoint_normals must have one row for each core point"));
    }
    let viewpoints = viewpoints.as_ref().map(points).transpose()?;
    let found = attended(py, &Listeners::progress(progress), |progress| {
        let outward = match &viewpoints {
            Some(positions) => OutwardReference::Towards(positions),
            None => OutwardReference::Direction(Vector3::from(direction)),
        };
        measure(clouds, &core, given.as_deref(), &outward, &params, progress)
    })?;
    let found = found.map_err(explained)?;
    let column = |value: fn(&ChangePoint) -> Option<f64>| {
        let values: Vec<f64> = found.iter().map(|p| value(p).unwrap_or(f64::NAN)).collect();
        values.into_pyarray(py)
    };
    let count = |epoch: usize| {
        let counts: Vec<u32> = found.iter().map(|p| p.counts[epoch]).collect();
        counts.into_pyarray(py)
    };
    let normals: Vec<Vector3<f64>> = found.iter().map(|p| p.normal).collect();
    Ok((
        column(|p| p.distance_m),
        column(|p| p.detection_limit_m),
        [column(|p| p.spread_m[0]), column(|p| p.spread_m[1])],
        [count(0), count(1)],
        from_vectors(py, &normals)?,
    ))
}

/// One entry for each core point.
fn measure(
    clouds: [Vec<Point3<f64>>; 2],
    core: &[Point3<f64>],
    given: Option<&[Vector3<f64>]>,
    outward: &OutwardReference<'_>,
    params: &M3c2Params,
    progress: &dyn Progress,
) -> Result<Vec<ChangePoint>, Interrupted> {
    progress.begin("M3C2", core.len() as u64);
    let [first, second] = clouds.map(|mut points| {
        points.retain(|p| p.iter().all(|c| c.is_finite()));
        GridIndex::new(&points, params.cylinder_radius_m)
    });
    let mut found = Vec::with_capacity(core.len());
    for (number, batch) in core.chunks(BATCH).enumerate() {
        progress.check()?;
        let normals: Vec<Option<Vector3<f64>>> = match given {
            Some(normals) => {
                let start = number * BATCH;
                let unit =
                    |n: &Vector3<f64>| n.try_normalize(0.0).filter(|n| n.iter().all(|c| c.is_finite()));
                normals[start..start + batch.len()].iter().map(unit).collect()
            }
            None => estimate_normals(&first, batch, params.normal_radius_m, outward),
        };
        let usable = batch.iter().zip(&normals).filter_map(|(p, n)| Some((*p, (*n)?)));
        let (places, directions): (Vec<Point3<f64>>, Vec<Vector3<f64>>) = usable.unzip();
        let mut measured = compare(&first, &second, &places, &directions, params)
            .points
            .into_iter();
        found.extend(batch.iter().zip(&normals).map(|(position, normal)| {
            let of_normal = normal.and_then(|_| measured.next());
            of_normal.unwrap_or_else(|| without_normal(*position))
        }));
        progress.advance(batch.len() as u64);
    }
    Ok(found)
}

/// A core point whose surroundings have no plane.
fn without_normal(position: Point3<f64>) -> ChangePoint {
    ChangePoint {
        position,
        normal: Vector3::repeat(f64::NAN),
        distance_m: None,
        detection_limit_m: None,
        spread_m: [None; 2],
        counts: [0; 2],
    }
}

/// Indices of the points that stay when every voxel keeps the one nearest to its middle.
#[pyfunction]
pub fn thin<'py>(
    py: Python<'py>,
    points_1: PyReadonlyArray2<'py, f64>,
    spacing: f64,
) -> PyResult<Bound<'py, PyArray1<i64>>> {
    if !(spacing.is_finite() && spacing > 0.0) {
        return Err(error(format!(
            "core_spacing is {spacing}, it must be a positive length in metres"
        )));
    }
    let cloud = points(&points_1)?;
    let kept = py.detach(|| thin_to_voxels(&cloud, spacing));
    let kept: Vec<i64> = kept.into_iter().map(|i| i as i64).collect();
    Ok(kept.into_pyarray(py))
}
