//! Photos without masks: their stones, as the detector finds them.

use super::voting_photo::{Instance, PHOTOS, STEP, VotingPhoto, check_any, label_path, posed_photos};
use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::storage::step::{Key, StepDir};
use crate::project::Epoch;
use crate::warnings::Warnings;
use stonewise_core::geometry::View;
use stonewise_io::image_io::read_rgb;
use stonewise_io::masks::write_label_png;
use stonewise_segment::tiling::segment_photo;
use stonewise_segment::{Segmentation, StoneFinder, Weights};

/// Finds the stones of every posed photo of an epoch; photos that an interrupted run finished are taken over.
pub fn detect_stones(context: &Context, epoch: &Epoch, name: &str) -> Result<StepDir> {
    let params = &context.project.settings.segment;
    let weights = Weights::named(&params.model);
    let digest = match &weights {
        Weights::BuiltIn => blake3::hash(
            &weights
                .bytes()
                .map_err(|error| no_masks(context, epoch, &error))?,
        )
        .to_hex()
        .to_string(),
        Weights::File(path) => context.digest(path)?,
    };
    let digests = [
        context.digest(&epoch.cameras)?,
        context.digest(&epoch.images)?,
        digest,
    ];
    let key = Key::new(STEP, &params.tiling, &digests.each_ref().map(String::as_str));
    context.step(name, key, |step, warnings| {
        let photos = write_stones(context, epoch, &weights, step, warnings)?;
        write_json(&step.file(PHOTOS), &photos)
    })
}

fn no_masks(context: &Context, epoch: &Epoch, error: &impl std::fmt::Display) -> Error {
    Error::Survey(format!(
        "epoch {:?} has no masks, and no detector can find its stones ({error}): add `masks = ...` (COCO json or a folder of \
         16-bit label PNGs) to the epoch, or `model = ...` to [segment], in {}",
        epoch.name,
        context.project.path.display()
    ))
}

fn write_stones(
    context: &Context,
    epoch: &Epoch,
    weights: &Weights,
    step: &StepDir,
    warnings: &Warnings,
) -> Result<Vec<VotingPhoto>> {
    let tiling = &context.project.settings.segment.tiling;
    let detector = StoneFinder::open(weights, tiling.min_score as f32)?;
    let candidates = posed_photos(epoch, warnings)?;
    let tiles = |view: &View| tiling.tile_count(view.camera.width, view.camera.height);
    let total = candidates.iter().map(|(view, _)| tiles(view)).sum();
    context.progress.begin("tiles", total);
    let mut photos: Vec<VotingPhoto> = Vec::new();
    let count = candidates.len();
    for (number, (view, path)) in (1..).zip(candidates) {
        context.progress.detail(&format!("photo {number} of {count}"));
        // Photos that are left out are left out again by a run that goes on, so that the numbers stay the
        // same.
        let unit = format!("{:05}", photos.len());
        let done = format!("{unit}.json");
        if step.has(&unit) {
            context.progress.advance(tiles(&view));
            photos.push(read_json(&step.file(&done))?);
            continue;
        }
        let image = match read_rgb(&path) {
            Ok(image) => image,
            Err(error) => {
                warnings.skipped(STEP, path.to_string_lossy(), error.to_string());
                context.progress.advance(tiles(&view));
                continue;
            }
        };
        let (found, expected) = (
            [image.width(), image.height()],
            [view.camera.width, view.camera.height],
        );
        if found != expected {
            let message = format!(
                "the photo is {}x{} px, its camera {}x{} px: give the photo as it was posed",
                found[0], found[1], expected[0], expected[1]
            );
            warnings.skipped(STEP, path.to_string_lossy(), message);
            context.progress.advance(tiles(&view));
            continue;
        }
        let stones = segment_photo(&detector, &image, tiling, context.progress)?;
        write_label_png(&label_path(step, photos.len()), &stones.labels)?;
        let photo = VotingPhoto {
            camera: view.name,
            path,
            instances: instances(&stones),
        };
        write_json(&step.file(&done), &photo)?;
        step.keep(&unit, &[&done, &format!("{unit}.png")])?;
        photos.push(photo);
    }
    check_any(&photos, epoch, warnings)?;
    Ok(photos)
}

fn instances(stones: &Segmentation) -> Vec<Instance> {
    let instance = |(&id, &score): (&u32, &f32)| Instance {
        id,
        score: f64::from(score),
        stone_ref: None,
    };
    stones.scores.iter().map(instance).collect()
}
