//! A look at a survey before the work: what will go wrong, in seconds.

mod alignment;
mod cameras;
mod clouds;
mod depth;
mod edges;
mod finding;
mod handed;
mod likeness;
mod masks;
mod origin;
mod page;
mod photos;
mod repeats;
mod resources;
mod sample;
mod stable;
mod unreadable;

pub use depth::Depth;
pub use finding::{Finding, Report, Verdict};
pub use resources::require_memory_of_clouds;
pub use resources::{free_disk, free_memory, is_about_this_machine, require_memory_of_run};

use crate::{Epoch, PhotoFiles, Project};
use std::path::Path;
use stonewise_base::error::Result;
use stonewise_base::messages::findings::{CAMERAS, MASKS, PHOTOS};
use stonewise_core::progress::Progress;
use stonewise_io::cameras::{CameraError, CameraFile, MapFrame, read_cameras_on_map};
use unreadable::Unreadable;

/// Looks at everything that a project names.
///
/// Extents and units, coordinate systems, overlap, point spacing; photos; cameras against clouds; disk,
/// memory and time. `out`: where the results are to go, for the disk's free space.
///
/// What cannot be read is a line of the report at full depth.
///
/// # Errors
/// At quick depth, a cloud or a camera file cannot be read; the caller stopped it.
pub fn check(project: &Project, out: &Path, depth: Depth, progress: &dyn Progress) -> Result<Report> {
    progress.begin("check", project.epochs.len() as u64);
    let mut report = Report::default();
    let mut unreadable = Unreadable::new(depth);
    let mut surveys = Vec::new();
    let mut searched = Vec::new();

    for epoch in &project.epochs {
        progress.check()?;
        let survey = sample::sample(epoch, depth, &mut unreadable)?;
        let cameras = match &epoch.photos {
            Some(files) => unreadable.keep(epoch, &CAMERAS, cameras_of(epoch, files, survey.is_some()))?,
            None => {
                report.findings.push(photos::none(epoch));
                None
            }
        };
        if let (Some(cameras), Some(files)) = (cameras.flatten(), &epoch.photos) {
            let photos = unreadable.keep(epoch, &PHOTOS, photos::look(project, epoch, files, &cameras))?;
            let are_listed = photos.is_some();
            let (findings, photos) = photos.unwrap_or_default();
            if epoch.masks.is_none() {
                let sizes = photos
                    .iter()
                    .map(|(view, _)| [view.camera.width, view.camera.height]);
                searched.extend(sizes);
            }
            report.findings.extend(findings);
            // A run finds out while it reads them.
            if depth == Depth::Full && are_listed {
                let found = unreadable.keep(epoch, &MASKS, masks::look(epoch, &photos, progress))?;
                report.findings.extend(found.unwrap_or_default());
            }
            if let Some(survey) = survey.as_ref().filter(|_| are_listed) {
                if depth == Depth::Full {
                    report
                        .findings
                        .extend(likeness::look(epoch, &photos, survey, progress)?);
                }
                let found = cameras::look(epoch, &photos, survey, depth);
                let (findings, picture) = unreadable.keep(epoch, &CAMERAS, found)?.unwrap_or_default();
                report.findings.extend(findings);
                report.pictures.extend(picture);
            }
        }
        surveys.push(survey);
        progress.advance(1);
    }

    masks::say_once(project, &mut report.findings);
    report.findings.extend(unreadable.findings);
    report.findings.extend(clouds::look(project, &surveys));
    // What cannot be read is named above.
    report
        .findings
        .extend(origin::look(project, &surveys).unwrap_or_default());
    report.findings.extend(repeats::look(project, &surveys));
    report.findings.extend(handed::look(project, &surveys));
    report.findings.extend(stable::look(project, &surveys));

    if surveys.iter().all(Option::is_some) {
        report
            .findings
            .extend(resources::look(project, &surveys, &searched, depth, out));
    }

    report.sort(project);
    Ok(report)
}

/// The cameras of an epoch, in the frame of its clouds. Where a cloud cannot be read, the cameras serve to find
/// the photos alone, and it does not matter whether they can be brought to that frame: `None`, if they cannot.
fn cameras_of(epoch: &Epoch, files: &PhotoFiles, clouds_are_read: bool) -> Result<Option<CameraFile>> {
    if clouds_are_read {
        return epoch.read_cameras().map(Some);
    }
    match read_cameras_on_map(&files.cameras, Some(&files.images), &MapFrame::default()) {
        Err(CameraError::UnsupportedCrs { .. }) => Ok(None),
        read => Ok(Some(read?)),
    }
}
