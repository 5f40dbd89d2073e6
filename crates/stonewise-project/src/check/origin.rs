//! What the points of each epoch come from, and what fixes the scale and bends clouds from photos.

use super::finding::{Finding, Verdict};
use super::sample::Sample;
use crate::{Epoch, Origin, Project};
use stonewise_base::error::Result;
use stonewise_base::messages::findings::{
    FROM_PHOTOS, FROM_SCANNER, FROM_UNKNOWN, NO_LENGTH, ONE_BUNDLE, ORIGIN, OWN_BUNDLE, SCALE,
};
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::Camera;

pub(super) fn look(project: &Project, surveys: &[Option<Sample>]) -> Result<Vec<Finding>> {
    let mut found = Vec::new();
    let mut from_photos = Vec::new();
    for (number, (epoch, survey)) in project.epochs.iter().zip(surveys).enumerate() {
        if survey.is_none() {
            continue;
        }
        let origin = epoch.found_origin()?;
        let (verdict, text) = match origin {
            Some(Origin::Scanner) => (Verdict::Fine, &FROM_SCANNER),
            Some(Origin::Photos) => (Verdict::Fine, &FROM_PHOTOS),
            None => (Verdict::Note, &FROM_UNKNOWN),
        };
        found.push(Finding::new(&epoch.name, &ORIGIN, verdict, text.say(&[])));
        if origin == Some(Origin::Photos) && !epoch.is_of_reference_survey() {
            from_photos.push((EpochId::at(number), epoch));
        }
    }
    let Some((first, rest)) = from_photos.split_first() else {
        return Ok(found);
    };
    let cameras = |epoch: &Epoch| -> Result<Vec<Camera>> {
        Ok(epoch
            .posed_photos()?
            .into_iter()
            .map(|(view, _)| view.camera)
            .collect())
    };
    let of_first = cameras(first.1)?;
    for (id, epoch) in rest {
        let own = cameras(epoch)?;
        let is_one = project.is_one_bundle([first.0, *id], [of_first.iter(), own.iter()]);
        if of_first.is_empty() || own.is_empty() {
            continue;
        }
        let text = match is_one {
            true => ONE_BUNDLE.say(&[]),
            false => OWN_BUNDLE.say(&[]),
        };
        let verdict = if is_one { Verdict::Fine } else { Verdict::Note };
        found.push(Finding::new(&epoch.name, &ORIGIN, verdict, text));
        let has_length = |id: EpochId| project.distances.iter().any(|d| d.epoch == id);
        let is_scaled = is_one || has_length(first.0) && has_length(*id);
        if !is_scaled {
            found.push(Finding::new(
                &epoch.name,
                &SCALE,
                Verdict::Note,
                NO_LENGTH.say(&[]),
            ));
        }
    }
    Ok(found)
}
