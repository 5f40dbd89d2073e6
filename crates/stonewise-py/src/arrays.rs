//! Arrays in and out.

use crate::error::error;
use nalgebra::{Point3, Vector3};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

/// Points from an (n, 3) array, metres.
pub fn points(array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Point3<f64>>> {
    Ok(rows(array)?.into_iter().map(Point3::from).collect())
}

/// Vectors from an (n, 3) array.
pub fn vectors(array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Vector3<f64>>> {
    Ok(rows(array)?.into_iter().map(Vector3::from).collect())
}

/// An (n, 3) array.
pub fn from_vectors<'py>(py: Python<'py>, vectors: &[Vector3<f64>]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat = vectors.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
    table(py, vectors.len(), 3, flat)
}

/// An array from its rows.
pub fn table<T: numpy::Element>(
    py: Python<'_>,
    rows: usize,
    columns: usize,
    flat: Vec<T>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let array = Array2::from_shape_vec((rows, columns), flat).map_err(|e| error(e.to_string()))?;
    Ok(array.into_pyarray(py))
}

fn rows(array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<[f64; 3]>> {
    let view = array.as_array();
    if view.ncols() != 3 {
        let message = format!("an array of shape (n, 3) is needed, not {:?}", view.shape());
        return Err(error(message));
    }
    Ok(view.rows().into_iter().map(|r| [r[0], r[1], r[2]]).collect())
}
