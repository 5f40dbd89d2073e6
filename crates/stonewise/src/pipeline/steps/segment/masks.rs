//! Photos with masks: their stones, as label images.

use super::voting_photo::{Instance, STEP, VotingPhoto, check_any, label_path, posed_photos};
use crate::error::Result;
use crate::pipeline::context::Context;
use crate::project::Epoch;
use crate::storage::step::StepDir;
use crate::texts::notices::NO_MASKS;
use crate::warnings::Warnings;
use rayon::prelude::*;
use std::path::Path;
use stonewise_base::messages::findings::ONE_MASK_EACH;
use stonewise_io::masks::{MaskSource, write_label_png};

/// Brings the masks of every posed photo of an epoch into one label image each.
pub fn write_labels(
    context: &Context,
    epoch: &Epoch,
    masks: &Path,
    step: &StepDir,
    warnings: &Warnings,
) -> Result<Vec<VotingPhoto>> {
    let candidates = posed_photos(epoch, warnings)?;
    let source = MaskSource::open(masks)?;
    for remark in source.remarks() {
        warnings.notice(STEP, masks.to_string_lossy(), remark.as_str());
    }
    context.progress.begin("photos", candidates.len() as u64);
    let read = candidates
        .par_iter()
        .map(|(view, path)| {
            context.progress.check()?;
            let size = (view.camera.width, view.camera.height);
            let labelled = source.labels_for(&path.to_string_lossy(), size.0, size.1);
            context.progress.advance(1);
            Ok(match labelled {
                Ok(Some(labelled)) => Some(labelled),
                Ok(None) => {
                    warnings.skipped(
                        STEP,
                        path.to_string_lossy(),
                        NO_MASKS.say(&[("file", (&*masks.to_string_lossy()).into())]),
                    );
                    None
                }
                Err(error) => {
                    warnings.skipped(STEP, path.to_string_lossy(), error.to_string());
                    None
                }
            })
        })
        .collect::<Result<Vec<_>>>()?;

    let (mut photos, mut odd) = (Vec::new(), Vec::new());
    for ((view, path), labelled) in candidates.into_iter().zip(read) {
        let Some(labelled) = labelled else { continue };
        odd.extend(labelled.warnings);
        write_label_png(&label_path(step, photos.len()), &labelled.labels)?;
        let instances = labelled.instances.into_iter().map(Instance::from).collect();
        photos.push(VotingPhoto {
            camera: view.name,
            path,
            is_view: false,
            is_labelled: true,
            scale: None,
            instances,
        });
    }

    let file = masks.to_string_lossy();
    if let Some(first) = odd.first() {
        let more = match odd.len() {
            1 => String::new(),
            n => format!("; {} more of its remarks on photos are alike", n - 1),
        };
        warnings.notice(STEP, file.clone(), format!("{first}{more}"));
    }
    if photos.len() > 1 && photos.iter().all(|photo| photo.instances.len() <= 1) {
        warnings.doubt(
            STEP,
            file.clone(),
            ONE_MASK_EACH.say(&[("file", (&*file).into())]),
        );
    }
    check_any(&photos, epoch, warnings)?;
    Ok(photos)
}
