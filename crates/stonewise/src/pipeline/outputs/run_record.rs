//! `run.json`: what was run, on what, how, and how long it took.

use super::crs::coordinate_system;
use crate::error::{Error, Result};
use crate::files::write_readable_json;
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::segment::Segmented;
use crate::project::Epoch;
use crate::results::names::RUN;
use crate::results::records::{
    CrsRecord, DatumState, EpochRecord, InputRecord, ProjectRecord, RunRecord, Timestamp, Verdict,
};
use std::path::Path;

/// Writes `run.json`; `datums`: what is known about the registration of each later epoch, `verdict`: the
/// verdict on the run.
pub fn write_run_record(
    context: &Context,
    photos: &[Segmented],
    labelled: &[Labelled],
    datums: &[DatumState],
    verdict: &Verdict,
) -> Result<()> {
    let project = context.project;
    let found = photos.iter().zip(labelled);
    let epochs = project.epochs.iter().zip(found);
    let later = project.epochs.iter().skip(1).map(|e| e.name.clone());
    let record = RunRecord {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        finished_at: Timestamp::now(),
        project: ProjectRecord {
            name: project.name.clone(),
            file: project.path.clone(),
        },
        crs: coordinate_system(project)?.map(|crs| CrsRecord {
            epsg: crs.epsg,
            name: crs.name,
            wkt: crs.wkt,
        }),
        datum: later.zip(datums.iter().copied()).collect(),
        verdict: Some(verdict.headlines()),
        epochs: epochs
            .map(|(epoch, (photos, labelled))| epoch_record(context, epoch, photos, labelled))
            .collect::<Result<_>>()?,
        part: project.part.clone(),
        edits: project
            .edits
            .as_ref()
            .map(|edits| input(context, &edits.path))
            .transpose()?,
        parameters: project.settings.clone(),
        steps: context.times(),
        warnings: context.warnings.recorded(project.settings.report.language),
    };
    write_readable_json(&context.out.join(RUN), &record)
}

fn epoch_record(
    context: &Context,
    epoch: &Epoch,
    photos: &Segmented,
    labelled: &Labelled,
) -> Result<EpochRecord> {
    let input = |path: &Path| input(context, path);
    Ok(EpochRecord {
        name: epoch.name.clone(),
        date: epoch.date.clone(),
        conditions: epoch.conditions.clone(),
        clouds: epoch.clouds.iter().map(|c| input(c)).collect::<Result<_>>()?,
        cameras: input(&epoch.cameras)?,
        masks: epoch.masks.as_deref().map(input).transpose()?,
        images: epoch.images.clone(),
        motion: epoch.motion.clone(),
        points: labelled.ingested.tiles.surveyed.point_count(),
        photos: photos.photos.len(),
        stones: labelled.stones.len(),
    })
}

fn input(context: &Context, path: &Path) -> Result<InputRecord> {
    Ok(InputRecord {
        path: path.to_path_buf(),
        bytes: std::fs::metadata(path).map_err(Error::io("reading", path))?.len(),
        blake3: context.digest(path)?,
    })
}
