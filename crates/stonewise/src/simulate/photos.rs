//! Photos, cameras and masks of one epoch.

use crate::simulate::write::create_folder;
use crate::simulate::{MaskFiles, SimulateError, SurveyParams};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use std::path::Path;
use stonewise_core::geometry::View;
use stonewise_core::progress::Progress;
use stonewise_core::raster::LabelImage;
use stonewise_core::simulate::{Scene, Studio, disturb_views, plan_views};
use stonewise_io::cameras::{write_colmap, write_metashape};
use stonewise_io::image_io::write_jpeg;
use stonewise_io::masks::{CocoPhoto, InstanceInfo, write_coco, write_label_png};

/// Takes and writes the photos of an epoch (0 or 1) with all that belongs to them; gives back the true labels.
pub fn write_photos(
    folder: &Path,
    scene: &Scene,
    params: &SurveyParams,
    epoch: usize,
    progress: &dyn Progress,
) -> Result<Vec<LabelImage>, SimulateError> {
    let number = epoch + 1;
    let seed = params
        .scene
        .seed
        .wrapping_mul(1000)
        .wrapping_add(10 + epoch as u64);
    let images = folder.join(format!("epoch{number}/images"));
    create_folder(&images)?;
    let exact = plan_views(scene, &params.photos, epoch, seed);
    let studio = Studio::new(scene, seed + 2);
    let mut labels = Vec::new();
    for view in &exact {
        progress.check()?;
        let photo = studio.photograph(view, &params.photos.sensor);
        let name = format!("{}.jpg", view.name);
        write_jpeg(&images.join(&name), &photo.image, params.jpeg_quality)?;
        labels.push(photo.labels);
        progress.advance(1);
    }
    write_cameras(folder, &exact, params, number, seed + 4)?;
    write_masks(folder, &exact, &labels, params, number, seed + 6)?;
    Ok(labels)
}

fn write_cameras(
    folder: &Path,
    exact: &[View],
    params: &SurveyParams,
    number: usize,
    seed: u64,
) -> Result<(), SimulateError> {
    let mut delivered = disturb_views(exact, &params.photos, seed);
    if params.photos.last_unaligned {
        delivered.pop();
    }
    write_metashape(
        &folder.join(format!("epoch{number}/cameras_metashape.xml")),
        &delivered,
        None,
    )?;
    let truth = folder.join(format!("truth/cameras_epoch{number}"));
    create_folder(&truth.join("colmap"))?;
    write_metashape(&truth.join("cameras_metashape.xml"), exact, None)?;
    write_colmap(&truth.join("colmap"), exact)?;
    Ok(())
}

/// Masks for the project, with numbers that say nothing about the stone, and the true ones beside them.
fn write_masks(
    folder: &Path,
    views: &[View],
    labels: &[LabelImage],
    params: &SurveyParams,
    number: usize,
    seed: u64,
) -> Result<(), SimulateError> {
    let names: Vec<String> = views.iter().map(|v| format!("{}.jpg", v.name)).collect();
    create_folder(&folder.join("truth/masks"))?;
    let known: Vec<Vec<InstanceInfo>> = labels.iter().map(true_instances).collect();
    let truth = folder.join(format!("truth/masks/epoch{number}_coco.json"));
    write_coco(&truth, &coco_photos(&names, labels, &known))?;

    let shuffled: Vec<LabelImage> = labels.iter().zip(seed..).map(|(l, s)| shuffle(l, s)).collect();
    match params.masks {
        MaskFiles::None => {}
        MaskFiles::Coco => {
            create_folder(&folder.join("masks"))?;
            let unknown = vec![Vec::new(); shuffled.len()];
            let path = folder.join(format!("masks/epoch{number}.json"));
            write_coco(&path, &coco_photos(&names, &shuffled, &unknown))?;
        }
        MaskFiles::Png => {
            let masks = folder.join(format!("masks/epoch{number}"));
            create_folder(&masks)?;
            for (view, image) in views.iter().zip(&shuffled) {
                write_label_png(&masks.join(format!("{}.png", view.name)), image)?;
            }
        }
    }
    Ok(())
}

fn coco_photos<'a>(
    names: &'a [String],
    labels: &'a [LabelImage],
    instances: &'a [Vec<InstanceInfo>],
) -> Vec<CocoPhoto<'a>> {
    names
        .iter()
        .zip(labels)
        .zip(instances)
        .map(|((file_name, labels), instances)| CocoPhoto {
            file_name,
            labels,
            instances,
        })
        .collect()
}

fn present(labels: &LabelImage) -> Vec<u32> {
    let mut ids = labels.data().to_vec();
    ids.sort_unstable();
    ids.dedup();
    ids.retain(|&id| id > 0);
    ids
}

fn true_instances(labels: &LabelImage) -> Vec<InstanceInfo> {
    present(labels)
        .into_iter()
        .map(|id| InstanceInfo {
            id,
            score: 1.0,
            stone_ref: Some(u64::from(id)),
        })
        .collect()
}

/// The same masks, numbered from 1 in random order.
fn shuffle(labels: &LabelImage, seed: u64) -> LabelImage {
    let mut ids = present(labels);
    ids.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    let largest = ids.iter().copied().max().unwrap_or(0) as usize;
    let mut new = vec![0; largest + 1];
    for (number, &id) in (1..).zip(&ids) {
        new[id as usize] = number;
    }
    let mut shuffled = labels.clone();
    for label in shuffled.data_mut() {
        *label = new[*label as usize];
    }
    shuffled
}
