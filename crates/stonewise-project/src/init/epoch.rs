//! What a folder holds of one epoch.

use super::listing::{files, folders, has_extension, is_made_by_stonewise, name};
use std::path::{Path, PathBuf};
use stonewise_base::error::Result;
use stonewise_io::cameras::{
    CameraFile, MapFrame, find_photos, is_camera_file, is_sidecar_folder, read_cameras_on_map, unread_cameras,
};

/// Extensions of point clouds.
pub(super) const CLOUDS: [&str; 10] = [
    "laz", "las", "e57", "ptx", "pts", "ply", "xyz", "txt", "csv", "asc",
];
/// Folder of the masks beside those of the epochs.
pub(super) const MASKS: &str = "masks";
/// Extensions of photos.
const PHOTOS: [&str; 5] = ["jpg", "jpeg", "png", "tif", "tiff"];
/// Names of the files that make a folder a COLMAP model.
const COLMAP: [&str; 2] = ["images.txt", "images.bin"];
/// Ends of the names of texts that belong to cameras: those of COLMAP, lists of photos, and the files of an
/// OPF project.
const CAMERA_TEXTS: [&str; 10] = [
    "images.txt",
    "cameras.txt",
    "points3d.txt",
    "list.txt",
    "cameras.json",
    "camera_list.json",
    "reference_frame.json",
    "control_points.json",
    "constraints.json",
    "gps_bias.json",
];
/// Extensions of scans that lie beside each other: no texts, which may be anything.
const SCANS: [&str; 7] = ["laz", "las", "e57", "ptx", "pts", "ply", "xyz"];
/// Words in names of clouds, by sensor.
const SENSORS: [(&str, &[&str]); 2] = [
    ("terrestrial", &["tls", "terrestrial", "scanner"]),
    ("drone", &["uav", "drone", "uls", "flight"]),
];

/// What was found of one epoch; paths relative to the project's folder.
#[derive(Default)]
pub(super) struct Found {
    pub name: String,
    pub clouds: Vec<PathBuf>,
    pub images: Option<PathBuf>,
    pub cameras: Option<PathBuf>,
    pub masks: Option<PathBuf>,
    /// What was not taken, with the reason.
    pub left_out: Vec<(PathBuf, &'static str)>,
}

impl Found {
    /// Whether a file or folder of masks bears the epoch's name.
    pub fn is_mask(&self, path: &Path) -> bool {
        masks_of(&self.name).iter().any(|mask| path.ends_with(mask))
    }

    /// What was chosen and what was left out.
    pub fn lines(&self) -> Vec<String> {
        let join = |paths: &[PathBuf]| {
            let all: Vec<String> = paths.iter().map(|p| p.display().to_string()).collect();
            all.join(", ")
        };
        let one = |path: &Option<PathBuf>, none: &str| {
            path.as_ref().map_or(none.to_owned(), |p| p.display().to_string())
        };
        let mut lines = vec![format!(
            "{}: clouds {}; photos {}; cameras {}; masks {}",
            self.name,
            join(&self.clouds),
            one(&self.images, "not found"),
            one(&self.cameras, "not found"),
            one(&self.masks, "none, the detector finds the stones")
        )];
        let sensors = self.sensors();
        if sensors.len() > 1 {
            lines.push(format!(
                "{}: clouds of {} sensors by their names ({}); the sharpest that shows a stone measures it",
                self.name,
                sensors.len(),
                sensors.join(", ")
            ));
        }
        let left = self.left_out.iter();
        lines.extend(left.map(|(p, why)| format!("left out: {} ({why})", p.display())));
        lines
    }

    /// The sensors that the names of the clouds tell.
    fn sensors(&self) -> Vec<&'static str> {
        let has = |words: &[&str]| self.clouds.iter().any(|cloud| is_of(cloud, words));
        let told = SENSORS.iter().filter(|(_, words)| has(words));
        told.map(|(sensor, _)| *sensor).collect()
    }
}

/// Everything in a folder and below that may belong to an epoch.
#[derive(Default)]
struct Candidates {
    clouds: Vec<PathBuf>,
    photo_folders: Vec<PathBuf>,
    cameras: Vec<PathBuf>,
    masks: Vec<PathBuf>,
    /// Cameras in formats that are not read, with what to give instead.
    unread: Vec<(PathBuf, &'static str)>,
}

/// Looks into the folder of an epoch; `root`: folder of the project file.
pub(super) fn look(root: &Path, folder: &Path) -> Result<Found> {
    let mut found = Candidates::default();
    gather(folder, &mut found)?;
    let own_name = folder
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    found.masks.extend(masks_beside(root, &own_name));
    let relative = |path: &Path| path.strip_prefix(root).unwrap_or(path).to_path_buf();
    let mut epoch = Found {
        name: own_name,
        clouds: found.clouds.iter().map(|p| relative(p)).collect(),
        ..Found::default()
    };
    let unread = found.unread.iter();
    epoch
        .left_out
        .extend(unread.map(|(file, instead)| (relative(file), *instead)));
    let images = photo_choices(folder, &found);
    let (cameras, photos) = best(&found.cameras, &images);
    for camera in found.cameras.iter().filter(|c| Some(*c) != cameras.as_ref()) {
        epoch.left_out.push((
            relative(camera),
            "another camera file has as many of the photos, or more",
        ));
    }
    for other in &found.photo_folders {
        if photos.as_ref().is_some_and(|chosen| !other.starts_with(chosen)) {
            epoch
                .left_out
                .push((relative(other), "the camera file has fewer of these photos"));
        }
    }
    for other in found.masks.iter().skip(1) {
        epoch
            .left_out
            .push((relative(other), "other masks were found first"));
    }
    epoch.images = photos.map(|p| relative(&p));
    epoch.cameras = cameras.map(|p| relative(&p));
    epoch.masks = found.masks.first().map(|p| relative(p));
    Ok(epoch)
}

/// Scans that lie in the folder of the project file: an epoch for each name, without the word for a sensor.
pub(super) fn scans_beside(root: &Path) -> Result<Vec<Found>> {
    let mut epochs: Vec<Found> = Vec::new();
    for scan in files(root)?.into_iter().filter(|f| has_extension(f, &SCANS)) {
        let mut own_name = scan
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        for word in SENSORS.iter().flat_map(|(_, words)| *words) {
            if let Some(at) = own_name.to_ascii_lowercase().find(word) {
                own_name.replace_range(at..at + word.len(), "");
            }
        }
        let own_name = own_name.trim_matches(|c: char| !c.is_alphanumeric()).to_owned();
        let cloud = scan.strip_prefix(root).unwrap_or(&scan).to_path_buf();
        match epochs.iter_mut().find(|e| e.name == own_name) {
            Some(epoch) => epoch.clouds.push(cloud),
            None => epochs.push(Found {
                name: own_name,
                clouds: vec![cloud],
                ..Found::default()
            }),
        }
    }
    Ok(epochs)
}

fn gather(dir: &Path, found: &mut Candidates) -> Result<()> {
    let files = files(dir)?;
    let is_colmap = files.iter().any(|f| COLMAP.contains(&name(f).as_str()));
    let is_masks = name(dir).contains("mask");
    if is_colmap || is_sidecar_folder(dir) {
        found.cameras.push(dir.to_path_buf());
    }
    if files.iter().any(|f| has_extension(f, &PHOTOS)) {
        let list = if is_masks {
            &mut found.masks
        } else {
            &mut found.photo_folders
        };
        list.push(dir.to_path_buf());
    }
    for file in &files {
        if let Some(instead) = unread_cameras(file) {
            found.unread.push((file.clone(), instead));
        } else if is_camera_file(file) {
            found.cameras.push(file.clone());
        } else if CAMERA_TEXTS.iter().any(|end| name(file).ends_with(end)) {
            continue;
        } else if has_extension(file, &["json"]) {
            found.masks.push(file.clone());
        } else if has_extension(file, &CLOUDS) {
            found.clouds.push(file.clone());
        }
    }
    for below in folders(dir)? {
        if !is_made_by_stonewise(&below) && name(&below) != "truth" {
            gather(&below, found)?;
        }
    }
    Ok(())
}

/// Masks of an epoch beside the folders of the epochs.
fn masks_beside(root: &Path, epoch: &str) -> Vec<PathBuf> {
    let choices = masks_of(epoch).into_iter().map(|p| root.join(p));
    choices.filter(|p| p.exists()).collect()
}

/// `masks/EPOCH.json` and `masks/EPOCH`.
fn masks_of(epoch: &str) -> [PathBuf; 2] {
    let folder = Path::new(MASKS);
    [folder.join(format!("{epoch}.json")), folder.join(epoch)]
}

/// Folders that may be the epoch's photos: the folder above all photos, if no masks lie in it, then each.
fn photo_choices(folder: &Path, found: &Candidates) -> Vec<PathBuf> {
    let mut choices = found.photo_folders.clone();
    if let [first, .., _] = found.photo_folders.as_slice() {
        let above = first
            .ancestors()
            .find(|a| found.photo_folders.iter().all(|p| p.starts_with(a)));
        let above = above
            .filter(|a| a.starts_with(folder) && !found.masks.iter().any(|m| m.is_dir() && m.starts_with(a)));
        if let Some(above) = above {
            choices.insert(0, above.to_path_buf());
        }
    }
    choices
}

/// The camera file and the folder that have the most photos in common; the first of them where none has any.
fn best(cameras: &[PathBuf], images: &[PathBuf]) -> (Option<PathBuf>, Option<PathBuf>) {
    let mut chosen = (cameras.first().cloned(), images.first().cloned());
    let mut most = 0;
    for path in cameras {
        for folder in images {
            let Ok(file) = read_cameras_on_map(path, Some(folder), &MapFrame::default()) else {
                continue;
            };
            let n = photos_of(&file, folder);
            if n > most {
                most = n;
                chosen = (Some(path.clone()), Some(folder.clone()));
            }
        }
    }
    chosen
}

fn photos_of(cameras: &CameraFile, folder: &Path) -> usize {
    find_photos(folder, cameras).map_or(0, |photos| photos.paths.iter().flatten().count())
}

fn is_of(cloud: &Path, words: &[&str]) -> bool {
    let text = cloud.to_string_lossy().to_lowercase();
    words.iter().any(|w| text.contains(w))
}
