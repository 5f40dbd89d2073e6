//! `run.json`: what was run, on what, how, and how long it took.

use super::crs::coordinate_system;
use crate::error::{Error, Result};
use crate::files::{relative, resolved, write_readable_json};
use crate::pipeline::context::Context;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::outputs::influence::INFLUENCE;
use crate::pipeline::steps::segment::VotingPhoto;
use crate::pipeline::until::Until;
use crate::processor_class;
use crate::project::Epoch;
use crate::results::names::RUN;
use crate::results::records::{
    CrsRecord, EpochRecord, InputRecord, PhotoScale, ProjectRecord, RunRecord, Timestamp,
};
use crate::storage::step::code_version;
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_core::epoch::EpochId;
use stonewise_io::cloud::{Created, cloud_date};

/// Writes `run.json`, once all its contents are known.
pub static RECORD: Step = Step {
    name: "record",
    needs: &[Need::same(&INFLUENCE)],
    wanted: |until| until >= Until::Registered,
    make: |run, _| write_run_record(run),
    ..Step::PLAIN
};

fn write_run_record(run: &Run) -> Result<()> {
    let context = run.context;
    let mut datum = BTreeMap::new();
    for later in context.project.epochs.later_ids() {
        let name = context.project.epochs[later].name.clone();
        datum.insert(name, run.measured(later)?.datum.state);
    }

    let project = context.project;
    let record = RunRecord {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        program: code_version(),
        processor: processor_class().to_owned(),
        finished_at: Timestamp::now(),
        project: ProjectRecord {
            name: project.name.clone(),
            file: relative(&context.out, &project.path).unwrap_or_else(|| resolved(&project.path)),
        },
        crs: coordinate_system(project)?.map(|crs| CrsRecord {
            epsg: crs.epsg,
            name: crs.name,
            wkt: crs.wkt,
        }),
        datum,
        verdict: Some(run.verdict()?.headlines()),
        epochs: { project.epochs.ids() }
            .map(|epoch| epoch_record(run, epoch))
            .collect::<Result<_>>()?,
        part: project.part.clone(),
        edits: project
            .edits
            .as_ref()
            .map(|edits| input(context, &edits.path))
            .transpose()?,
        conditions: project
            .conditions
            .as_ref()
            .map(|file| input(context, &file.path))
            .transpose()?,
        instruments: project
            .instrument_files()
            .map(|file| input(context, file))
            .collect::<Result<_>>()?,
        parameters: project.settings.clone(),
        steps: context.times(),
        warnings: context.warnings.recorded(project.settings.report.language),
    };

    write_readable_json(&context.out.join(RUN), &record)
}

fn epoch_record(run: &Run, id: EpochId) -> Result<EpochRecord> {
    let (context, epoch) = (run.context, &run.context.project.epochs[id]);
    let (photos, labelled) = (run.posed(id)?, run.labelled(id)?);
    let input = |path: &Path| input(context, path);
    Ok(EpochRecord {
        name: epoch.name.clone(),
        date: epoch.date.clone(),
        conditions: epoch.conditions.clone(),
        clouds: epoch
            .clouds
            .iter()
            .map(|c| cloud(context, c))
            .collect::<Result<_>>()?,
        cameras: epoch.photos.as_ref().map(|p| input(&p.cameras)).transpose()?,
        masks: epoch.masks.as_deref().map(input).transpose()?,
        images: epoch.photos.as_ref().map(|p| p.images.clone()),
        motion: epoch.motion.clone(),
        points: labelled.ingested.tiles.surveyed.point_count(),
        photo_count: photos.shown_count(),
        photos: { photos.photos.iter() }
            .filter_map(|p| looked_at(epoch, p))
            .collect(),
        stones: labelled.stones.len(),
    })
}

/// A photo that the detector looked at.
fn looked_at(epoch: &Epoch, photo: &VotingPhoto) -> Option<PhotoScale> {
    let folder = epoch.photos.as_ref().map(|files| files.images.as_path());
    let relative = folder.and_then(|folder| photo.path.strip_prefix(folder).ok());
    let name = || photo.path.file_name().map(Path::new);
    Some(PhotoScale {
        photo: relative.or_else(name)?.to_path_buf(),
        scale: photo.scale?,
    })
}

fn cloud(context: &Context, path: &Path) -> Result<InputRecord> {
    Ok(InputRecord {
        written: match cloud_date(path)? {
            Some(Created::Day(day)) => Some(day),
            Some(Created::Gps(_)) | None => None,
        },
        ..input(context, path)?
    })
}

fn input(context: &Context, path: &Path) -> Result<InputRecord> {
    Ok(InputRecord {
        path: path.to_path_buf(),
        bytes: std::fs::metadata(path).map_err(Error::io("reading", path))?.len(),
        blake3: context.digest(path)?,
        written: None,
    })
}
