//! The files of a variant: surveys, masks and cameras.

use super::cases::{Change, Variant, changed};
use crate::error::{Error, Result};
use crate::experiment::simulation::not_simulated;
use crate::files::{read_json, write_json};
use crate::project::Project;
use crate::storage::step::Key;
use crate::storage::store::StepStore;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_core::geometry::View;
use stonewise_core::progress::Progress;

use stonewise_io::cameras::{read_cameras, write_metashape};
use stonewise_io::masks::{MaskSource, write_label_png};
use stonewise_simulate::{
    MaskError, PhotoParams, SurveyParams, disturb_views, mean_iou, spoil_masks, write_survey,
};

/// What a variant is measured on.
pub(super) struct Inputs {
    /// Projects with the name of their scanner.
    pub projects: Vec<(&'static str, Project)>,
    /// Table of true stones.
    pub truth: PathBuf,
    /// Where it lies on the axis of its influence.
    pub x: f64,
}

/// Makes a variant's files, or takes those of an earlier run from the store.
pub(super) fn inputs(
    variant: &Variant,
    base: &SurveyParams,
    store: &StepStore,
    progress: &dyn Progress,
) -> Result<Inputs> {
    let params = changed(base, variant.change);
    let key = Key::new("survey", &params, &[]);
    let (survey, _) = store.step("survey", key, &[], |dir| {
        write_survey(&dir.file("survey"), &params, progress)
            .map(|_| ())
            .map_err(not_simulated)
    })?;
    let folder = survey.file("survey");
    let mut projects = vec![("TLS", Project::read(&folder.join("stonewise.toml"))?)];
    if params.scene.uav.is_some() {
        projects.push(("UAV", Project::read(&folder.join("stonewise_uav.toml"))?));
    }
    let mut x = variant.x;
    match variant.change {
        Change::Masks(error) => {
            let (masks, iou) = spoilt_masks(&projects[0].1, error, &params, survey.key().as_str(), store)?;
            x = iou;
            for (_, project) in &mut projects {
                for (epoch, folder) in project.epochs.iter_mut().zip(&masks) {
                    epoch.masks = Some(folder.clone());
                }
            }
        }
        Change::Pose(_) | Change::Photos(_) => {
            let key = Key::new("cameras", &variant.change, &[survey.key().as_str()]);
            let (dir, _) = store.step("cameras", key, &[], |dir| {
                (1..=2).try_for_each(|number| {
                    let exact = folder.join(format!("truth/cameras_epoch{number}/cameras_metashape.xml"));
                    let delivered = folder.join(format!("epoch{number}/cameras_metashape.xml"));
                    let views = other_views(variant.change, [&exact, &delivered], &params, number)?;
                    Ok(write_metashape(&dir.file(cameras_name(number)), &views, None)?)
                })
            })?;
            for (_, project) in &mut projects {
                for (number, epoch) in (1..).zip(project.epochs.iter_mut()) {
                    if let Some(photos) = &mut epoch.photos {
                        photos.cameras = dir.file(cameras_name(number));
                    }
                }
            }
        }
        _ => {}
    }
    Ok(Inputs {
        projects,
        truth: folder.join("truth/stones.csv"),
        x,
    })
}

fn cameras_name(number: u64) -> String {
    format!("cameras_{number}.xml")
}

/// Views with another error of their poses, or fewer of them.
fn other_views(
    change: Change,
    [exact, delivered]: [&Path; 2],
    params: &SurveyParams,
    number: u64,
) -> Result<Vec<View>> {
    if let Change::Pose(pose_noise_px) = change {
        let photos = PhotoParams {
            pose_noise_px,
            ..params.photos.clone()
        };
        let views = read_cameras(exact)?.views;
        return Ok(disturb_views(
            &views,
            &photos,
            params.scene.seed.wrapping_mul(100) + number,
        ));
    }
    let mut views = read_cameras(delivered)?.views;
    if let Change::Photos(wanted) = change {
        // Evenly over the flight, so that few photos show all of the wall too.
        let all = views.len();
        let chosen: Vec<usize> = (0..wanted.min(all))
            .map(|i| (2 * i + 1) * all / (2 * wanted))
            .collect();
        views = chosen.into_iter().map(|i| views[i].clone()).collect();
    }
    Ok(views)
}

/// Folders with spoilt masks of both epochs, and their mean IoU with the true ones.
fn spoilt_masks(
    project: &Project,
    error: MaskError,
    params: &SurveyParams,
    survey: &str,
    store: &StepStore,
) -> Result<([PathBuf; 2], f64)> {
    let key = Key::new("masks", &error, &[survey]);
    let (dir, _) = store.step("masks", key, &[], |dir| {
        let mut ious = Vec::new();
        for (number, epoch) in (1u64..).zip(&project.epochs) {
            let folder = dir.file(number.to_string());
            fs::create_dir_all(&folder).map_err(Error::io("making a folder", &folder))?;
            let source = MaskSource::open(epoch.masks.as_deref().unwrap_or(&folder))?;
            let views = epoch.read_cameras()?.views;
            for (photo, view) in (0u64..).zip(&views) {
                let name = format!("{}.jpg", view.name);
                let (width, height) = (view.camera.width, view.camera.height);
                let Some(found) = source.labels_for(&name, width, height)? else {
                    continue;
                };
                let seed = params.scene.seed.wrapping_mul(10_000) + 100 * number + photo;
                let spoilt = spoil_masks(&found.labels, error, seed);
                ious.extend(mean_iou(&spoilt, &found.labels));
                write_label_png(&folder.join(format!("{}.png", view.name)), &spoilt)?;
            }
        }
        let mean = ious.iter().sum::<f64>() / ious.len().max(1) as f64;
        write_json(&dir.file("iou.json"), &mean)
    })?;
    Ok((["1", "2"].map(|n| dir.file(n)), read_json(&dir.file("iou.json"))?))
}
