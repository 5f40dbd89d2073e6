//! Halves of one epoch, made once an experiment.

use crate::error::Result;
use crate::project::{Epoch, Project};
use crate::split;
use crate::storage::step::Key;
use crate::storage::store::StepStore;
use stonewise_core::progress::Progress;
use stonewise_io::cameras::find_photos;

/// The project of the two halves of an epoch, with the settings, the part and the edits of the whole; nothing
/// moved between them.
///
/// Made by [`crate::split()`], or taken from the store where an earlier run of the experiment made them.
pub(super) fn halves_of(
    project: &Project,
    epoch: &Epoch,
    seed: u64,
    store: &StepStore,
    progress: &dyn Progress,
) -> Result<Project> {
    let mut digests = Vec::new();
    let mut photos = Vec::new();
    if let Some(files) = &epoch.photos {
        digests.push(store.digest(&files.cameras)?);
        photos = find_photos(&files.images, &epoch.read_cameras()?)?.paths;
    }

    for cloud in &epoch.clouds {
        digests.push(store.digest(cloud)?);
    }
    if let Some(edits) = &project.edits {
        digests.push(store.digest(&edits.path)?);
    }
    let key = Key::new(
        "halves",
        &(seed, photos, &epoch.masks),
        &digests.iter().map(String::as_str).collect::<Vec<_>>(),
    );
    let (dir, _) = store.step("halves", key, &[], |dir| {
        let halves = split(project, epoch, seed, dir.path(), progress)?;
        for edit in &halves.left_out {
            progress.note(&format!("left out: {edit}"));
        }
        Ok(())
    })?;

    let halves = Project::read(&dir.file("stonewise.toml"))?;
    Ok(Project {
        settings: project.settings.clone(),
        part: project.part.clone(),
        ..halves
    })
}
