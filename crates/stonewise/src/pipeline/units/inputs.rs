//! The inputs of a plan: what they hold, and whether they are still the same.

use crate::error::{Error, Result};
use crate::pipeline::context::Context;
use crate::pipeline::steps::segment::photo_files;
use crate::storage::step::look_of;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// An input as the plan lists it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PlannedInput {
    /// File or folder.
    pub path: PathBuf,
    /// Digest of names, lengths and times of change: compared by every unit, which reads no input that it
    /// does not need.
    pub look: String,
    /// Digest of the content.
    pub blake3: String,
}

/// All inputs of a project with their digests. The folders of photos count where no masks do; where stones
/// are tracked in photos, every photo that has a camera counts, too.
pub(super) fn inputs_of(context: &Context) -> Result<Vec<PlannedInput>> {
    let project = context.project;
    let images = |path: &PathBuf| {
        project
            .epochs
            .iter()
            .any(|e| e.masks.is_some() && e.photos.as_ref().is_some_and(|p| p.images == *path))
    };
    let mut used: Vec<PathBuf> = project.inputs();
    used.retain(|path| !images(path));
    if project.settings.registration.photos.enabled {
        for epoch in &project.epochs {
            used.extend(photo_files(epoch)?);
        }
    }
    used.into_iter()
        .map(|path| {
            Ok(PlannedInput {
                look: look_of(&path, true)?,
                blake3: context.digest(&path)?,
                path,
            })
        })
        .collect()
}

/// Digests of the inputs, if all of them are as they were; `plan`: the file to name otherwise.
pub(super) fn unchanged(inputs: &[PlannedInput], plan: &Path) -> Result<BTreeMap<PathBuf, String>> {
    for input in inputs {
        if look_of(&input.path, true).ok().as_deref() != Some(&input.look) {
            return Err(Error::Plan {
                path: plan.to_path_buf(),
                message: format!(
                    "{} was changed or moved since the plan was made: run `stonewise run --plan` again",
                    input.path.display()
                ),
            });
        }
    }
    Ok(inputs
        .iter()
        .map(|i| (i.path.clone(), i.blake3.clone()))
        .collect())
}
