//! A run in units, for clusters.

use crate::attended::{Listeners, STACK_BYTES, attended};
use crate::command::parameters_of;
use crate::error::{error, explained};
use pyo3::prelude::*;
use rayon::ThreadPoolBuilder;
use std::path::PathBuf;
use stonewise::Coordinator;

/// A plan whose folder nobody else may use while this object lives.
#[pyclass(frozen)]
pub struct Plan {
    coordinator: Coordinator,
}

#[pymethods]
impl Plan {
    /// The plan as JSON.
    #[getter]
    fn json(&self) -> PyResult<String> {
        serde_json::to_string(&self.coordinator.plan).map_err(|e| error(e.to_string()))
    }
}

/// Plans the units of a run; `parameters`: JSON of what replaces parameters of the project file.
#[pyfunction]
pub fn plan(
    py: Python<'_>,
    project: PathBuf,
    out: PathBuf,
    parameters: &str,
    force: bool,
    progress: Option<Py<PyAny>>,
    note: Option<Py<PyAny>>,
) -> PyResult<Plan> {
    let parameters = parameters_of(parameters)?;
    let planned = attended(py, &Listeners { progress, note }, |progress| {
        stonewise::plan(&project, &parameters, &out, force, progress)
    })?;
    Ok(Plan {
        coordinator: planned.map_err(explained)?,
    })
}

/// Does one unit of the plan in a folder with this number of threads.
#[pyfunction]
pub fn unit(py: Python<'_>, out: PathBuf, unit: &str, threads: usize) -> PyResult<()> {
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .stack_size(STACK_BYTES)
        .build()
        .map_err(|e| error(e.to_string()))?;
    let done = attended(py, &Listeners::progress(None), |progress| {
        pool.install(|| stonewise::do_unit(&out, unit, progress).map(drop))
    })?;
    done.map_err(explained)
}

/// Says which file this module was loaded from: its digest tells one build from another.
#[pyfunction]
pub fn loaded_from(file: PathBuf) {
    stonewise::set_program(file);
}
