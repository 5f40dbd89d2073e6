//! Doing one unit of a plan.

use super::inputs::unchanged;
use super::list::Unit;
use super::plan::Plan;
use super::receipt::{Receipt, plan_file, times};
use crate::error::{Error, Result};
use crate::output::OutputFolder;
use crate::pipeline::Summary;
use crate::pipeline::clock::Clock;
use crate::pipeline::context::Context;
use crate::pipeline::graph::{Run, Task};
use crate::pipeline::list::tasks;
use crate::pipeline::run::run_in;
use crate::pipeline::until::Until;
use crate::processor_class;
use crate::project::Project;
use crate::storage::step::code_version;
use std::path::Path;
use stonewise_core::progress::Progress;

/// A unit that is done.
pub struct UnitDone {
    /// The project.
    pub project: Project,
    /// Whether it was done before.
    pub was_done: bool,
    /// What the run did as a whole, where this was its last unit.
    pub summary: Option<Summary>,
}

/// Does one unit of the plan in a results folder.
///
/// A unit that is done is left as it is. Any number of processes may do units at the same time, also the same
/// one; their files appear whole or not at all.
///
/// # Errors
/// No such unit; a unit that it needs is not done; the plan is that of other inputs, or of another program; a
/// run works in the folder; whatever the step may fail with.
pub fn do_unit(out: &Path, id: &str, progress: &dyn Progress) -> Result<UnitDone> {
    let file = plan_file(out);
    let stale = |message: &str| Error::Plan {
        path: file.clone(),
        message: message.to_owned(),
    };

    // Without a plan there is nothing to lock.
    Plan::read(out)?;
    let folder = OutputFolder::of_unit(out)?;
    let plan = Plan::read(out)?;
    let Some(unit) = plan.units.iter().find(|u| u.id == id) else {
        return Err(stale(&format!("no unit {id:?} in this plan")));
    };

    if plan.program != code_version() {
        return Err(stale(
            "the plan was made by another build of stonewise: do its units with the same, or run `stonewise run --plan` again",
        ));
    }

    if plan.processor != processor_class() {
        return Err(stale(&format!(
            "the plan was made on a processor of the class \"{}\", and this one is \"{}\", where the last digits of results may differ: \
             plan and do units on machines of one class",
            plan.processor,
            processor_class()
        )));
    }

    let project = Project::read(&plan.project)?.with_parameters(&plan.parameters)?;
    let digests = unchanged(&plan.inputs, &file)?;
    if Receipt::read(out, &plan.id, id).is_some() {
        return Ok(UnitDone {
            project,
            was_done: true,
            summary: None,
        });
    }

    refuse_too_early(out, &plan, unit)?;
    let clock = Clock::start();
    let summary = {
        let mut context = Context::of_unit(&project, &folder, digests, progress)?;
        context.forced = Some(plan.forced);
        context.unit_times = times(out, &plan.id, plan.units.iter().map(|u| u.id.as_str()));
        let is_last = plan.units.last().is_some_and(|last| last.id == id);
        let summary = match is_last {
            true => Some(run_in(&context, Until::Reported)?),
            false => do_step(&context, unit).map(|()| None)?,
        };
        if is_last {
            context.store.remove_unused()?;
        }
        summary
    };

    if summary.is_some() {
        // All other units are done, and what they left unfinished when they were killed is of no use.
        folder.sweep(&project);
        folder.finish_results(&project, true)?;
    }

    Receipt::write(out, &plan.id, id, &clock)?;
    Ok(UnitDone {
        project,
        was_done: false,
        summary,
    })
}

fn refuse_too_early(out: &Path, plan: &Plan, unit: &Unit) -> Result<()> {
    let is_missing = |id: &&String| Receipt::read(out, &plan.id, id).is_none();
    let first: Vec<String> = unit.needs.iter().filter(is_missing).cloned().collect();
    match first.is_empty() {
        true => Ok(()),
        false => Err(Error::UnitFirst {
            unit: unit.id.clone(),
            first,
        }),
    }
}

/// Does what a unit stands for.
fn do_step(context: &Context, unit: &Unit) -> Result<()> {
    let run = Run::new(context, Until::Reported);
    let name = unit.id.split('.').next().unwrap_or_default();
    let mut tasks = tasks(context.project, Until::Reported).into_iter();
    let Some(Task { step, epoch }) = tasks.find(|task| task.id() == name) else {
        return Err(Error::Plan {
            path: plan_file(&context.out),
            message: format!(
                "this build of stonewise has no step {name:?}: run `stonewise run --plan` again"
            ),
        });
    };
    match (&step.photos, unit.photo) {
        (Some(photos), Some(number)) => (photos.make)(&run, epoch, number),
        _ => (step.make)(&run, epoch),
    }
}
