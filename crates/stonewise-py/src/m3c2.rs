//! Comparison along normals.

use crate::arrays::{from_vectors, points, vectors};
use crate::attended::{Listeners, attended};
use crate::error::{error, explained};
use nalgebra::Vector3;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use stonewise_core::change::{
    ChangePoint, CoreNormals, M3c2Params, OutwardReference, m3c2_clouds, thin_to_voxels,
};

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
    let clouds = [points(&points_1)?, points(&points_2)?];
    let core = points(&core_points)?;
    let given = normals.as_ref().map(vectors).transpose()?;
    let viewpoints = viewpoints.as_ref().map(points).transpose()?;

    let found = attended(py, &Listeners::progress(progress), |progress| {
        let normals = match (&given, &viewpoints) {
            (Some(normals), _) => CoreNormals::Given(normals),
            (None, Some(places)) => CoreNormals::Fitted(OutwardReference::Towards(places)),
            (None, None) => CoreNormals::Fitted(OutwardReference::Direction(direction.into())),
        };
        m3c2_clouds(clouds, &core, &normals, &params, progress)
    })?;
    let found = found.map_err(explained)?.points;
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
