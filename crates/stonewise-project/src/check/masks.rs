//! Can the masks be read, are there some for every photo, and how many of them will be used?

use super::finding::{Finding, Verdict};
use super::photos::{PosedPhoto, some};
use crate::{Epoch, Project};
use rayon::prelude::*;
use stonewise_base::error::{Error, Result};
use stonewise_base::messages::Said;
use stonewise_base::messages::findings::{
    BROKEN_MASKS, MASKS, NO_MASK_FITS, NO_MASK_USABLE, ONE_MASK_EACH, WITHOUT_MASKS,
};
use stonewise_core::progress::Progress;
use stonewise_io::masks::MaskSource;

/// What a photo's masks are like.
enum Masks {
    /// How many will be used, and what is said of the others.
    There(usize, Vec<String>),
    Missing(String),
    /// Photo, and why they cannot be used.
    Broken(String, String),
}

/// Says once of a survey what is the same mistake in several epochs: one mask in each photo.
pub(super) fn say_once(project: &Project, findings: &mut Vec<Finding>) {
    let is_that = |f: &Finding| f.code.as_deref() == ONE_MASK_EACH.code && f.verdict == Verdict::Doubt;
    let epochs: Vec<String> = findings
        .iter()
        .filter(|f| is_that(f))
        .map(|f| f.epoch.clone())
        .collect();
    if epochs.len() < 2 {
        return;
    }
    findings.retain(|f| !is_that(f));
    let masks = project
        .epochs
        .iter()
        .filter(|e| epochs.contains(&e.name))
        .filter_map(|e| e.masks.as_ref());
    let mut files: Vec<String> = masks.map(|file| file.display().to_string()).collect();
    files.dedup();
    let text = ONE_MASK_EACH.say(&[("file", files.join(", ").into())]);
    findings.push(Finding::new("", &MASKS, Verdict::Doubt, text));
}

/// Decodes the masks of every photo that is there, as a run will.
///
/// # Errors
/// The file or folder of masks cannot be read; the caller stopped it.
pub(super) fn look(epoch: &Epoch, photos: &[PosedPhoto], progress: &dyn Progress) -> Result<Vec<Finding>> {
    let Some(file) = &epoch.masks else {
        return Ok(Vec::new());
    };
    let source = MaskSource::open(file)?;

    // That no photo is there is said elsewhere.
    if photos.is_empty() {
        return Ok(Vec::new());
    }

    let of_photo = |(view, path): &PosedPhoto| {
        progress.check()?;
        let size = (view.camera.width, view.camera.height);
        let masks = match source.labels_for(&path.to_string_lossy(), size.0, size.1) {
            Ok(Some(labelled)) => Masks::There(labelled.instances.len(), labelled.warnings),
            Ok(None) => Masks::Missing(view.name.clone()),
            Err(error) => Masks::Broken(view.name.clone(), error.to_string()),
        };
        Ok::<_, Error>(masks)
    };

    let masks = photos.par_iter().map(of_photo).collect::<Result<Vec<_>>>()?;
    let file = file.to_string_lossy();
    let finding = |verdict, text: Said| Finding::new(&epoch.name, &MASKS, verdict, text);
    let (mut found, mut missing, mut broken) = (Vec::new(), Vec::new(), Vec::new());
    let (mut counts, mut warnings) = (Vec::new(), Vec::new());

    for masks in masks {
        match masks {
            Masks::There(count, said) => {
                counts.push(count);
                warnings.extend(said);
            }
            Masks::Missing(photo) => missing.push(photo),
            Masks::Broken(photo, reason) => broken.push((photo, reason)),
        }
    }

    let (there, used) = (counts.len(), counts.iter().sum::<usize>());
    if there == 0 && broken.is_empty() {
        let text = NO_MASK_FITS.say(&[("file", (&*file).into())]);
        return Ok(vec![finding(Verdict::Unreadable, text)]);
    }

    if let Some((_, reason)) = broken.first() {
        let photos: Vec<String> = broken.iter().map(|(photo, _)| photo.clone()).collect();
        let text = BROKEN_MASKS.say(&[("photos", some(&photos).into()), ("reason", (&**reason).into())]);
        let verdict = match there {
            0 => Verdict::Unreadable,
            _ => Verdict::Doubt,
        };
        found.push(finding(verdict, text));
    }

    if !missing.is_empty() {
        let text = WITHOUT_MASKS.say(&[("file", (&*file).into()), ("photos", some(&missing).into())]);
        found.push(finding(Verdict::Doubt, text));
    }

    if there > 0 && used == 0 {
        found.push(finding(
            Verdict::Wrong,
            NO_MASK_USABLE.say(&[("file", (&*file).into())]),
        ));
    } else if there > 1 && counts.iter().all(|count| *count <= 1) {
        found.push(finding(
            Verdict::Doubt,
            ONE_MASK_EACH.say(&[("file", (&*file).into())]),
        ));
    }
    if found.is_empty() {
        let text = format!("there for every photo ({there}): {used} masks");
        found.push(finding(Verdict::Fine, text.into()));
    }
    found.extend(
        source
            .remarks()
            .iter()
            .map(|remark| finding(Verdict::Note, remark.as_str().into())),
    );
    if !warnings.is_empty() {
        found.push(finding(Verdict::Note, some(&warnings).into()));
    }

    Ok(found)
}
