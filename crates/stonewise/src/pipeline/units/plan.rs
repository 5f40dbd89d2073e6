//! The units of a run, and who coordinates them.

use super::inputs::{PlannedInput, inputs_of};
use super::list::{Unit, units_of};
use super::receipt::{Receipt, plan_file, withdraw, withdraw_all};
use crate::error::{Error, Result};
use crate::files::write_readable_json;
use crate::output::{OutputFolder, UNFINISHED_FILE};
use crate::pipeline::context::Context;
use crate::pipeline::graph::Run;
use crate::pipeline::steps::check::CHECK;
use crate::pipeline::until::Until;
use crate::processor_class;
use crate::project::Project;
use crate::results::names::RUN;
use crate::storage::step::{Key, code_version};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_core::epoch::EpochId;
use stonewise_core::progress::Progress;

/// Version of the document.
const VERSION: u64 = 2;

/// The units of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Version of this document.
    pub version: u64,
    /// Digest of everything that the results depend on: inputs, parameters, program.
    pub id: String,
    /// Version of stonewise.
    pub stonewise: String,
    /// Digest of the program; every unit has to be done by the same.
    pub program: String,
    /// Class of the processor; every unit has to be done on one of the same.
    pub processor: String,
    /// The project file.
    pub project: PathBuf,
    /// Parameters that replace those of the project file.
    pub parameters: Map<String, Value>,
    /// Whether the work goes on in spite of findings against it.
    pub forced: bool,
    pub(super) inputs: Vec<PlannedInput>,
    /// The units, each after those that it needs.
    pub units: Vec<Unit>,
}

/// Holds a results folder while others do the units of its plan: no run and no other plan may begin there.
#[derive(Debug)]
pub struct Coordinator {
    /// The plan.
    pub plan: Plan,
    _folder: OutputFolder,
}

/// Plans the units of a run in a folder and notes the plan there.
///
/// Units that were done for the same plan stay done; results of an earlier run lie aside until the last unit
/// is done. `parameters` replace those of the project file; `force`: write into a folder that holds other things,
/// and go on in spite of findings against the survey. Every input is read once for its digest.
///
/// # Errors
/// A project file that is wrong, an input that cannot be read, a survey that cannot be right, a folder that
/// must not be written into, a full disk, interruption.
pub fn plan(
    project: &Path,
    parameters: &Map<String, Value>,
    out: &Path,
    force: bool,
    progress: &dyn Progress,
) -> Result<Coordinator> {
    // Units are done by processes in other folders.
    let path = std::path::absolute(project).map_err(Error::io("finding", project))?;
    let project = Project::read(&path)?.with_parameters(parameters)?;
    let folder = OutputFolder::of_project(out, &project, force)?;
    let mut plan = {
        let mut context = Context::new(&project, &folder, progress)?;
        context.forced = Some(force);
        (CHECK.make)(&Run::new(&context, Until::Reported), EpochId::REFERENCE)?;
        Plan::of(&context, parameters, force)?
    };
    plan.take_over(out)?;
    if plan.units.iter().any(|unit| !unit.done) {
        folder.begin_results(&project)?;
    }
    write_readable_json(&plan_file(out), &plan)?;
    Ok(Coordinator {
        plan,
        _folder: folder.admit_units()?,
    })
}

impl Plan {
    fn of(context: &Context, parameters: &Map<String, Value>, force: bool) -> Result<Self> {
        let project = context.project;
        let inputs = inputs_of(context)?;
        let units = units_of(project)?;
        let program = code_version();
        let digests: Vec<&str> = inputs.iter().map(|i| i.blake3.as_str()).collect();
        let paths: Vec<&PathBuf> = inputs.iter().map(|i| &i.path).collect();
        let id = Key::new("plan", &(&project.settings, paths, &units, force), &digests);
        Ok(Self {
            version: VERSION,
            id: id.as_str().to_owned(),
            stonewise: env!("CARGO_PKG_VERSION").to_owned(),
            program,
            processor: processor_class().to_owned(),
            project: project.path.clone(),
            parameters: parameters.clone(),
            forced: force,
            inputs,
            units,
        })
    }

    /// Notes which units were done for the same plan earlier; other receipts go.
    fn take_over(&mut self, out: &Path) -> Result<()> {
        if Self::read(out).ok().is_none_or(|earlier| earlier.id != self.id) {
            return withdraw_all(out);
        }
        for unit in &mut self.units {
            unit.done = Receipt::read(out, &self.id, &unit.id).is_some();
        }
        // The last unit writes the tables.
        let is_finished = out.join(RUN).exists() && !out.join(UNFINISHED_FILE).exists();
        let all_done = is_finished && self.units.iter().all(|unit| unit.done);
        if let Some(last) = self.units.last_mut().filter(|_| !all_done) {
            last.done = false;
            withdraw(out, &last.id)?;
        }
        Ok(())
    }

    /// The plan of a results folder.
    ///
    /// # Errors
    /// There is none, or one of another version.
    pub fn read(out: &Path) -> Result<Self> {
        let path = plan_file(out);
        let none = |message: &str| Error::Plan {
            path: path.clone(),
            message: message.to_owned(),
        };
        let text = fs::read(&path)
            .map_err(|_| none("no plan here: run `stonewise run PROJECT --plan --out DIR` first"))?;
        let plan: Value = serde_json::from_slice(&text).unwrap_or_default();
        if let Some(version) = plan["version"].as_u64().filter(|version| *version != VERSION) {
            return Err(none(&format!(
                "the plan is of version {version}, this program does plans of version {VERSION}: run `stonewise run --plan` again"
            )));
        }
        serde_json::from_value(plan)
            .map_err(|_| none("the plan cannot be read: run `stonewise run --plan` again"))
    }
}
