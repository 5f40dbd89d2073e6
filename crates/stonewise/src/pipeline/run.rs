//! The method, from surveys to results: a walk over the steps.

use crate::error::Result;
use crate::output::OutputFolder;
use crate::pipeline::context::Context;
use crate::pipeline::graph::{Run, Task};
use crate::pipeline::list::{agenda, tasks};
use crate::pipeline::units::forget;
use crate::pipeline::until::Until;
use crate::project::Project;
use crate::results::StoneRow;
use crate::results::records::{Datum, Verdict};
use crate::warnings::Warning;
use crate::watched::Watched;
use stonewise_core::epoch::EpochId;
use stonewise_core::evaluate::Evaluation;
use stonewise_core::progress::Progress;
use stonewise_core::stone::Stone;

/// What a run did.
#[derive(Clone, Debug)]
pub struct Summary {
    /// What went wrong without stopping the run.
    pub warnings: Vec<Warning>,
    /// Each later epoch against the first.
    pub pairs: Vec<PairSummary>,
    /// The verdict; `None` where the run did not go so far.
    pub verdict: Option<Verdict>,
}

/// What came out for a later epoch against the first.
#[derive(Clone, Debug, Default)]
pub struct PairSummary {
    /// One row for each stone of the first epoch; empty where the run did not go so far.
    pub rows: Vec<StoneRow>,
    /// What is known about the registration of the epoch; `None` where the run did not go so far.
    pub datum: Option<Datum>,
    /// Where the project prescribes the motion, and the run went so far.
    pub evaluation: Option<Evaluation>,
}

impl Summary {
    /// Whether an input was left out.
    pub fn skipped_inputs(&self) -> bool {
        self.warnings.iter().any(|w| w.skipped_input)
    }

    /// Number of stones that the verdict says moved, over all later epochs.
    pub(crate) fn moved(&self) -> usize {
        let epochs = self.verdict.iter().flat_map(|v| &v.epochs);
        epochs.map(|e| e.wall.moved).sum()
    }

    /// Why the results as a whole cannot be relied on; none where they can, as far as the intervals say.
    pub fn doubts(&self) -> impl Iterator<Item = &Warning> {
        self.warnings.iter().filter(|w| w.doubt)
    }
}

/// Runs a project up to the step `until`, in the folder `out`; takes over whatever an earlier run finished
/// there.
///
/// Results of an earlier run lie aside until this one has finished.
///
/// The example of this crate shows it at work.
///
/// # Errors
/// An input that cannot be used, epochs that do not overlap, a full disk, interruption. Finished steps stay,
/// and the same call continues from there.
pub fn run(project: &Project, out: &OutputFolder, until: Until, progress: &dyn Progress) -> Result<Summary> {
    forget(out.path())?;
    out.begin_results(project)?;
    let watched = Watched::new(progress, out.path());
    let mut context = Context::new(project, out, &watched)?;
    context.forced = Some(out.is_forced());
    context.agenda = agenda(project, until);
    context.agenda.announce(&watched);
    let summary = run_in(&context, until)?;
    if until == Until::Reported {
        context.store.remove_unused()?;
    }
    out.finish_results(project, until == Until::Reported)?;
    watched.finish()?;
    Ok(summary)
}

/// Runs in a context of the caller's.
pub(crate) fn run_in(context: &Context, until: Until) -> Result<Summary> {
    let run = Run::new(context, until);
    for Task { step, epoch } in tasks(context.project, until) {
        context.progress.check()?;
        (step.make)(&run, epoch)?;
    }
    summary(&run)
}

/// Stones of the first epoch, before any prescribed motion is applied.
pub(crate) fn first_stones(context: &Context) -> Result<Vec<Stone>> {
    let run = Run::new(context, Until::Labelled);
    Ok(run.found(EpochId::REFERENCE)?.stones.clone())
}

fn summary(run: &Run) -> Result<Summary> {
    let context = run.context;
    let later = context.project.epochs.later_ids();
    let pairs = match run.until {
        Until::Segmented | Until::Labelled => Vec::new(),
        Until::Matched => later.map(|_| PairSummary::default()).collect(),
        _ => later.map(|epoch| pair(run, epoch)).collect::<Result<_>>()?,
    };
    let verdict = match run.until >= Until::Registered {
        true => Some(Verdict::clone(&*run.verdict()?)),
        false => None,
    };
    Ok(Summary {
        warnings: context.warnings.sorted(),
        pairs,
        verdict,
    })
}

fn pair(run: &Run, later: EpochId) -> Result<PairSummary> {
    let measured = run.measured(later)?;
    Ok(PairSummary {
        rows: measured.rows.clone(),
        datum: Some(measured.datum.clone()),
        evaluation: Option::clone(&*run.evaluated(later)?),
    })
}
