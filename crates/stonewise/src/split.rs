//! Two disjoint halves of one epoch, for testing the method against a known motion.

use crate::error::{Error, Result};
use crate::files::write_text;
use crate::init::quoted;
use crate::project::{Epoch, Project};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_core::progress::Progress;
use stonewise_core::statistics::split_mix;
use stonewise_io::cameras::find_photos;
use stonewise_io::cloud::{claimed_records, select_points};

/// Divides the points and the photos of an epoch at random into two halves, and writes them as a project of
/// two epochs.
///
/// Every point goes to one half by the toss of a coin; the photos are shuffled and dealt in turn, so that the
/// halves differ by one photo at most. The camera file and the masks are used where they are. Same seed, same
/// halves. Returns the new project file, which is written last.
///
/// Source: the experiment of the paper, section 4.
///
/// # Errors
/// A cloud or the folder of photos cannot be read; the files of the halves cannot be written; interruption.
pub fn split(
    project: &Project,
    epoch: &Epoch,
    seed: u64,
    out: &Path,
    progress: &dyn Progress,
) -> Result<PathBuf> {
    let photos = shuffled_photos(epoch, seed)?;
    if photos.len() < 2 {
        let message = format!(
            "posed photos in it: {}; two at least are needed to split an epoch",
            photos.len()
        );
        return Err(Error::Input {
            path: epoch.images.clone(),
            message,
        });
    }
    let mut text = format!(
        "[project]\nname = {}\n",
        quoted(&format!("{}, {} split", project.name, epoch.name))
    );
    if let Some(crs) = &epoch.map.crs {
        let _ = writeln!(text, "crs = {}", quoted(crs));
    }
    if epoch.map.false_origin != [0.0; 3] {
        let _ = writeln!(text, "false_origin = {:?}", epoch.map.false_origin);
    }
    for half in 0..2usize {
        let folder = out.join(format!("half{}", half + 1));
        let images = folder.join("images");
        fs::create_dir_all(&images).map_err(Error::io("making a folder", &images))?;
        for photo in photos.iter().skip(half).step_by(2) {
            progress.check()?;
            let copy = images.join(photo.file_name().unwrap_or_default());
            fs::copy(photo, &copy).map_err(Error::io("copying a photo to", &copy))?;
        }
        let mut clouds = Vec::new();
        for (number, cloud) in epoch.clouds.iter().enumerate() {
            let name = format!("half{}/cloud_{}.laz", half + 1, number + 1);
            progress.begin(
                &format!("split {}", cloud.display()),
                claimed_records(cloud)?.unwrap_or(0),
            );
            let salt = seed ^ (number as u64) << 32;
            select_points(cloud, &out.join(&name), |index| {
                progress.advance(1);
                progress.check()?;
                Ok::<bool, Error>((split_mix(index ^ split_mix(salt)) & 1) as usize == half)
            })?;
            clouds.push(quoted(&name));
        }
        let _ = write!(
            text,
            "\n[[epochs]]\nname = \"half {}\"\nclouds = [{}]\nimages = \"half{}/images\"\ncameras = {}\n",
            half + 1,
            clouds.join(", "),
            half + 1,
            absolute(&epoch.cameras)?
        );
        if let Some(masks) = &epoch.masks {
            let _ = writeln!(text, "masks = {}", absolute(masks)?);
        }
        if half == 1 {
            text.push_str(
                "same_survey_as = \"half 1\"   # the same stations and strips, with the same errors\n",
            );
        }
    }
    text.push_str(
        "# motion = { kind = \"translation\", d = [0.0, 0.02, 0.05] }   # moves the points of half 2 after labelling\n",
    );
    let path = out.join("stonewise.toml");
    write_text(&path, &text)?;
    Ok(path)
}

/// Posed photos of the epoch in an order that the seed decides.
fn shuffled_photos(epoch: &Epoch, seed: u64) -> Result<Vec<PathBuf>> {
    let photos = find_photos(&epoch.images, &epoch.read_cameras()?)?;
    let mut posed: Vec<PathBuf> = photos.paths.into_iter().flatten().collect();
    posed.sort();
    let mut keyed: Vec<(u64, PathBuf)> = posed
        .into_iter()
        .enumerate()
        .map(|(i, path)| (split_mix(i as u64 ^ split_mix(!seed)), path))
        .collect();
    keyed.sort();
    Ok(keyed.into_iter().map(|(_, path)| path).collect())
}

fn absolute(path: &Path) -> Result<String> {
    let path = path.canonicalize().map_err(Error::io("finding", path))?;
    Ok(quoted(&path.to_string_lossy()))
}
