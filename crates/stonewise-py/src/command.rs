//! The command, the run of a project, and simulated surveys.

use crate::attended::{Listeners, attended};
use crate::error::{error, explained};
use pyo3::prelude::*;
use serde_json::{Map, Value};
use std::ffi::OsString;
use std::path::PathBuf;
use stonewise::{OutputFolder, Project, Until};
use stonewise_simulate::SurveyParams;

/// Runs the command line of these arguments, the first of which is the program's name; returns the exit code.
#[pyfunction]
pub fn command(py: Python<'_>, args: Vec<OsString>) -> u8 {
    py.detach(|| stonewise_cli::main_with_args(args))
}

/// Runs a project; `parameters`: JSON of what replaces parameters of the project file.
#[pyfunction]
pub fn run(
    py: Python<'_>,
    project: PathBuf,
    out: PathBuf,
    parameters: &str,
    force: bool,
    progress: Option<Py<PyAny>>,
    note: Option<Py<PyAny>>,
) -> PyResult<()> {
    let parameters = parameters_of(parameters)?;
    let listeners = Listeners { progress, note };
    let outcome = attended(py, &listeners, |progress| -> anyhow::Result<()> {
        let project = Project::read(&project)?.with_parameters(&parameters)?;
        let folder = OutputFolder::of_project(&out, &project, force)?;
        stonewise_cli::measure(&folder, &project, Until::Reported, progress)?;
        Ok(())
    })?;
    outcome.map_err(explained)
}

/// Simulates a survey into a folder and returns its project file; `parameters`: JSON of the file of parameters.
#[pyfunction]
pub fn simulate(
    py: Python<'_>,
    out: PathBuf,
    parameters: &str,
    force: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<PathBuf> {
    let params: SurveyParams =
        serde_json::from_str(parameters).map_err(|e| error(format!("parameters: {e}")))?;
    let summary = attended(py, &Listeners::progress(progress), |progress| {
        stonewise_cli::simulate_survey(&out, &params, force, progress)
    })?;
    Ok(summary.map_err(explained)?.project)
}

/// Parameters from JSON.
pub fn parameters_of(json: &str) -> PyResult<Map<String, Value>> {
    serde_json::from_str(json).map_err(|e| error(format!("parameters: {e}")))
}
