//! The edits of an epoch, for the project of its halves.

use super::half::half_name;
use super::photos::PosedPhoto;
use crate::edits::{EditsFile, photo_named};
use crate::{Epoch, Project};
use std::path::Path;
use stonewise_base::error::{Error, Result};

/// Edits as the project of the halves names them.
pub(super) struct HalvesEdits {
    /// Edits that concern the epoch; both halves show the same wall, so each of them concerns both.
    pub file: EditsFile,
    /// Edits that concern it and cannot be applied to its halves, with the reason.
    pub left_out: Vec<String>,
}

/// The project's edits for the halves of this epoch, to be written to `path`.
///
/// A shape drawn in a photo stays in it: the photo belongs to one half, and the edit applies to both. Photos
/// are dealt to the halves in turn.
///
/// # Errors
/// An edit is in metres and the file has no `facade`: the outermost stones of a half may differ from those of
/// the epoch, so its own unrolled wall may have another origin.
pub(super) fn halves_edits(
    project: &Project,
    epoch: &Epoch,
    photos: &[PosedPhoto],
    path: &Path,
) -> Result<Option<HalvesEdits>> {
    let Some(given) = &project.edits else {
        return Ok(None);
    };
    let names: Vec<Vec<String>> = photos
        .iter()
        .map(|p| vec![p.view.clone(), p.path.to_string_lossy().into_owned()])
        .collect();
    let first = project.epochs.first().map_or("", |e| e.name.as_str());
    let mut file = EditsFile {
        facade: given.facade.clone(),
        ..EditsFile::empty(path)
    };
    let mut left_out = Vec::new();

    for (index, edit) in given.edits.iter().enumerate() {
        if !edit.concerns(&epoch.name) {
            continue;
        }
        let mut edit = edit.clone();
        edit.epochs = None;
        if let Some(photo) = &edit.photo {
            let drawn_in = edit.epoch.as_deref().unwrap_or(first);
            let half = if drawn_in == epoch.name {
                photo_named(photo, &names).map(|i| i % 2)
            } else {
                Err(format!("its photo {photo:?} belongs to epoch {drawn_in:?}"))
            };
            match half {
                Ok(half) => edit.epoch = Some(half_name(half)),
                Err(reason) => {
                    left_out.push(format!("{}: {reason}", given.place(index)));
                    continue;
                }
            }
        } else if given.facade.is_none() {
            return Err(no_wall(given, index));
        }
        file.edits.push(edit);
    }

    Ok(Some(HalvesEdits { file, left_out }))
}

fn no_wall(given: &EditsFile, index: usize) -> Error {
    Error::Project {
        path: given.path.clone(),
        line: given.lines.get(index).copied().unwrap_or(1),
        message: format!(
            "edit {} is in metres on the unrolled wall, whose origin may differ in the halves: put \"facade\" beside \
             \"edits\", with the content of facade.json from the results of a run with these edits",
            index + 1
        ),
    }
}
