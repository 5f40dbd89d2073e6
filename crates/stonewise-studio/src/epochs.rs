//! The epochs of a project, as the page shows them: their files and a picture of each.

use crate::place::Place;
use image::ImageFormat;
use image::imageops::FilterType;
use schemars::JsonSchema;
use serde::Serialize;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use stonewise::{Epoch, Project};

/// Longer edge of a picture, pixels.
const EDGE: u32 = 480;
/// Extensions of photos.
const PHOTOS: [&str; 5] = ["jpg", "jpeg", "png", "tif", "tiff"];
/// Photos are looked for so deep in their folder.
const DEPTH: usize = 3;

/// A file of a survey.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FileShown {
    /// Its path, relative to the project file where it lies beside or below it.
    pub name: String,
    /// Its length, bytes.
    pub bytes: u64,
}

/// An epoch.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct EpochShown {
    /// Its name.
    pub name: String,
    /// Its date, ISO 8601.
    pub date: Option<String>,
    /// Its clouds.
    pub clouds: Vec<FileShown>,
    /// Number of its photos.
    pub photos: usize,
    /// Whether a picture of it can be shown.
    pub has_picture: bool,
    /// Where its masks are; absent: the detector finds the stones.
    pub masks: Option<String>,
}

/// The epochs of a project in its order.
pub fn epochs(project: &Project, place: &Place) -> Vec<EpochShown> {
    let from = place.survey().unwrap_or(Path::new(""));
    let name = |path: &Path| path.strip_prefix(from).unwrap_or(path).display().to_string();
    let shown = |epoch: &Epoch| EpochShown {
        name: epoch.name.clone(),
        date: epoch.date.clone(),
        clouds: epoch
            .clouds
            .iter()
            .map(|cloud| FileShown {
                name: name(cloud),
                bytes: fs::metadata(cloud).map_or(0, |m| m.len()),
            })
            .collect(),
        photos: photos(epoch).len(),
        has_picture: photos(epoch).iter().any(|p| place.holds(p)),
        masks: epoch.masks.as_deref().map(name),
    };
    project.epochs.iter().map(shown).collect()
}

/// A small JPEG of the photo in the middle of an epoch's.
pub fn picture(epoch: &Epoch, place: &Place) -> Option<Vec<u8>> {
    let mut photos = photos(epoch);
    photos.retain(|photo| place.holds(photo));
    let photo = image::open(photos.get(photos.len() / 2)?).ok()?;
    let small = photo.resize(EDGE, EDGE, FilterType::Triangle).to_rgb8();
    let mut jpeg = Cursor::new(Vec::new());
    small.write_to(&mut jpeg, ImageFormat::Jpeg).ok()?;
    Some(jpeg.into_inner())
}

fn photos(epoch: &Epoch) -> Vec<PathBuf> {
    let mut found = Vec::new();
    if let Some(files) = &epoch.photos {
        search(&files.images, DEPTH, &mut found);
    }
    found.sort();
    found
}

fn search(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) {
    for path in fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|e| e.path())
    {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        if path.is_dir() {
            if depth > 1 {
                search(&path, depth - 1, found);
            }
        } else if extension.is_some_and(|e| PHOTOS.contains(&e.as_str())) {
            found.push(path);
        }
    }
}
