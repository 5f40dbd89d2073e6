//! The look at a survey with which every run begins.

use crate::check::{Depth, Report, Verdict, check, is_about_this_machine, require_memory_of_run};
use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::graph::{Phase, Run, Step};
use crate::storage::step::{Key, look_of};
use stonewise_core::epoch::EpochId;

/// A look at the survey before the work.
pub static CHECK: Step = Step {
    name: STEP,
    phase: Some(Phase::Read),
    make: |run, _| run.checked(),
    ..Step::PLAIN
};

/// Name of the step.
const STEP: &str = "check";

impl Run<'_> {
    fn checked(&self) -> Result<()> {
        match self.context.forced {
            Some(forced) => self
                .once(&CHECK, EpochId::REFERENCE, || look(self.context, forced))
                .map(drop),
            None => Ok(()),
        }
    }
}

/// Looks at the survey before the work. What is doubtful becomes a warning; what cannot be right stops the
/// run, unless it is forced.
///
/// # Errors
/// Something cannot be right; the address space is too small; a cloud or camera file cannot be read.
pub fn look(context: &Context, forced: bool) -> Result<()> {
    let project = context.project;
    if !forced {
        require_memory_of_run(project)?;
    }
    let mut inputs = Vec::new();

    for epoch in &project.epochs {
        for cloud in &epoch.clouds {
            inputs.push(context.digest(cloud)?);
        }
        if let Some(photos) = &epoch.photos {
            inputs.extend([context.digest(&photos.cameras)?, look_of(&photos.images, false)?]);
        }
    }

    let names: Vec<&String> = project.epochs.iter().map(|e| &e.name).collect();
    let key = Key::new(
        STEP,
        &(&names, &project.settings),
        &inputs.iter().map(String::as_str).collect::<Vec<_>>(),
    );
    let step = context.step(STEP, key, |step, _| {
        let report = check(project, &context.out, Depth::Quick, context.progress)?;
        write_json(&step.file("check.json"), &report)
    })?;
    let report: Report = read_json(&step.file("check.json"))?;
    let about_survey = || report.doubtful().filter(|f| !is_about_this_machine(f));
    let wrong: Vec<String> = about_survey()
        .filter(|f| f.verdict == Verdict::Wrong)
        .map(|f| format!("  {} {}: {}", f.epoch, f.topic, f.text))
        .collect();

    if !wrong.is_empty() && !forced {
        return Err(Error::Check(format!(
            "this survey cannot be right (--force goes on all the same; `stonewise check` shows more):\n{}",
            wrong.join("\n")
        )));
    }

    for finding in about_survey() {
        let subject = if finding.epoch.is_empty() {
            &project.name
        } else {
            &finding.epoch
        };
        context.warnings.doubt(STEP, subject, finding.said());
    }

    for finding in report.doubtful().filter(|f| is_about_this_machine(f)) {
        context.progress.note(&finding.said().english);
    }
    Ok(())
}
