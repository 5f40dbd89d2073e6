//! Are the photos there, whole, and as large as their cameras say?

use super::finding::{Finding, Verdict};
use crate::{Epoch, PhotoFiles, Project};
use std::path::PathBuf;
use stonewise_base::error::Result;
use stonewise_base::messages::Said;
use stonewise_base::messages::findings::{BROKEN_PHOTOS, MISSING_PHOTOS, NO_PHOTOS, PHOTO_SIZES, PHOTOS};
use stonewise_core::geometry::View;
use stonewise_io::cameras::{CameraFile, Photos, find_photos};
use stonewise_io::image_io::{image_size, photo_is_cut_off};

/// Names in a message at most.
const NAMES: usize = 4;

/// A photo that is there, with its view.
pub(super) type PosedPhoto<'a> = (&'a View, PathBuf);

/// An epoch without photos.
pub(super) fn none(epoch: &Epoch) -> Finding {
    let text = "none: stones are looked for in views of the clouds";
    Finding::new(&epoch.name, &PHOTOS, Verdict::Fine, text)
}

/// Looks at the header and the end of every photo that a camera names; the photos that are there.
pub(super) fn look<'a>(
    project: &Project,
    epoch: &Epoch,
    files: &PhotoFiles,
    cameras: &'a CameraFile,
) -> Result<(Vec<Finding>, Vec<PosedPhoto<'a>>)> {
    let photos = find_photos(&files.images, cameras)?;
    let posed = posed(cameras, &photos);
    let (mut broken, mut sizes) = (Vec::new(), Vec::new());
    for (view, path) in &posed {
        let name = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        match image_size(path) {
            Err(_) => broken.push(name),
            Ok(_) if photo_is_cut_off(path)? => broken.push(name),
            Ok((width, height)) if (width, height) != (view.camera.width, view.camera.height) => {
                sizes.push(format!(
                    "{name} {width}x{height} px (camera {}x{} px)",
                    view.camera.width, view.camera.height
                ));
            }
            Ok(_) => {}
        }
    }
    let mut out = Vec::new();
    let mut add = |verdict: Verdict, text: Said| out.push(Finding::new(&epoch.name, &PHOTOS, verdict, text));
    let (verdict, text) = presence(project, epoch, files, cameras, &photos);
    add(verdict, text);
    if !photos.without_camera.is_empty() {
        let names = photos.without_camera.iter();
        let names: Vec<String> = names
            .map(|p| p.file_name().unwrap_or_default().to_string_lossy().into_owned())
            .collect();
        add(
            Verdict::Note,
            format!("without a camera, left out: {}", some(&names)).into(),
        );
    }
    if !broken.is_empty() {
        add(
            Verdict::Doubt,
            BROKEN_PHOTOS.say(&[("photos", some(&broken).into())]),
        );
    }
    if !sizes.is_empty() {
        add(
            Verdict::Doubt,
            PHOTO_SIZES.say(&[("photos", some(&sizes).into())]),
        );
    }
    Ok((out, posed))
}

/// Which of the photos that the camera file names are there. Cameras that were oriented together may be in the
/// files of several epochs, whose photos lie in a folder each.
fn presence(
    project: &Project,
    epoch: &Epoch,
    files: &PhotoFiles,
    cameras: &CameraFile,
    photos: &Photos,
) -> (Verdict, Said) {
    let mut found: Vec<bool> = photos.paths.iter().map(Option::is_some).collect();
    let here = found.iter().filter(|found| **found).count();
    let total = found.len().to_string();
    let folder = files.images.to_string_lossy();
    if here == 0 {
        let file = files.cameras.to_string_lossy();
        let values = [
            ("total", total.into()),
            ("file", (&*file).into()),
            ("folder", (&*folder).into()),
        ];
        return (Verdict::Wrong, NO_PHOTOS.say(&values));
    }
    if here == found.len() {
        return (
            Verdict::Fine,
            format!("all {total} posed photos are there").into(),
        );
    }
    for other in project.epochs.iter().filter(|e| e.name != epoch.name) {
        // One that cannot be read is named where its own epoch is looked at.
        let theirs = posed_views(other).unwrap_or_default();
        for (view, found) in cameras.views.iter().zip(&mut found) {
            *found |= theirs.iter().any(|other| is_same(view, other));
        }
    }
    let missing = cameras.views.iter().zip(found).filter(|(_, found)| !found);
    let missing: Vec<String> = missing.map(|(view, _)| view.name.clone()).collect();
    if missing.is_empty() {
        let text = format!("{here} of the {total} posed photos are there, the others in another epoch");
        return (Verdict::Fine, text.into());
    }
    let (number, names) = (missing.len().to_string(), some(&missing));
    let values = [
        ("missing", number.into()),
        ("total", total.into()),
        ("folder", (&*folder).into()),
        ("photos", names.into()),
    ];
    (Verdict::Doubt, MISSING_PHOTOS.say(&values))
}

fn posed<'a>(cameras: &'a CameraFile, photos: &Photos) -> Vec<PosedPhoto<'a>> {
    let views = cameras.views.iter().zip(&photos.paths);
    views
        .filter_map(|(view, path)| Some((view, path.clone()?)))
        .collect()
}

/// Views whose photos are there.
fn posed_views(epoch: &Epoch) -> Result<Vec<View>> {
    let Some(files) = &epoch.photos else {
        return Ok(Vec::new());
    };
    let cameras = epoch.read_cameras()?;
    let photos = posed(&cameras, &find_photos(&files.images, &cameras)?);
    Ok(photos.into_iter().map(|(view, _)| view.clone()).collect())
}

/// Whether two camera files give one and the same photo.
fn is_same(one: &View, other: &View) -> bool {
    one.name == other.name && one.camera == other.camera && one.cam_from_world == other.cam_from_world
}

/// The first of many, and how many more.
pub(super) fn some(all: &[String]) -> String {
    let first = all.iter().take(NAMES).cloned().collect::<Vec<_>>().join(", ");
    match all.len().saturating_sub(NAMES) {
        0 => first,
        more => format!("{first} (+ {more})"),
    }
}
