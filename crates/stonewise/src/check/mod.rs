//! A look at a survey before the work: what will go wrong, in seconds.

mod alignment;
mod cameras;
mod clouds;
mod depth;
mod edges;
mod finding;
mod page;
mod photos;
mod repeats;
mod resources;
mod sample;

pub use depth::Depth;
pub use finding::{Finding, Report, Verdict};
pub use resources::require_memory_of_clouds;
pub(crate) use resources::{is_about_this_machine, require_memory_of_run};

use crate::error::Result;
use crate::project::Project;
use std::path::Path;
use stonewise_core::progress::Progress;

/// Looks at everything that a project names.
///
/// Extents and units, coordinate systems, overlap, point spacing; photos; cameras against clouds; disk,
/// memory and time. `out`: where the results are to go, for the disk's free space.
///
/// # Errors
/// A cloud or a camera file cannot be read, or the caller stopped it.
pub fn check(project: &Project, out: &Path, depth: Depth, progress: &dyn Progress) -> Result<Report> {
    progress.begin("check", project.epochs.len() as u64);
    let mut report = Report::default();
    let mut surveys = Vec::new();
    for epoch in &project.epochs {
        progress.check()?;
        let survey = sample::sample(epoch, depth)?;
        report.findings.extend(photos::look(project, epoch)?);
        let (findings, picture) = cameras::look(epoch, &survey, depth)?;
        report.findings.extend(findings);
        report.pictures.extend(picture);
        surveys.push(survey);
        progress.advance(1);
    }
    report.findings.extend(clouds::look(project, &surveys));
    report.findings.extend(repeats::look(project, &surveys));
    report.findings.extend(resources::look(project, &surveys, out));
    report.sort(project);
    Ok(report)
}
