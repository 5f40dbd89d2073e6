//! Two disjoint halves of one epoch, for testing the method against a known motion.

mod half;
mod halves_edits;
mod photos;

use crate::init::quoted;
use crate::{Epoch, PhotoChoice, Project};
use half::{half_folder, half_name};
use halves_edits::halves_edits;
use photos::{copy_photos, shuffled_photos};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_base::error::{Error, Result};
use stonewise_base::files::write_text;
use stonewise_core::progress::Progress;
use stonewise_core::statistics::split_mix;
use stonewise_io::cloud::{claimed_records, select_points};

/// The halves of an epoch, as written.
#[derive(Clone, Debug, PartialEq)]
pub struct Halves {
    /// The new project file.
    pub project: PathBuf,
    /// Edits by hand that concern the epoch and cannot be applied to its halves, with the reason.
    pub left_out: Vec<String>,
}

/// Files that [`split`] writes, and folders that it fills.
pub const SPLIT_FILES: [&str; 4] = ["stonewise.toml", EDITS, "half1", "half2"];

/// The file of edits, where the project has some.
const EDITS: &str = "edits.json";

/// Divides the points and the photos of an epoch at random into two halves, and writes them as a project of
/// two epochs.
///
/// Every point goes to one half by the toss of a coin; the photos are shuffled and dealt in turn, so that the
/// halves differ by one photo at most. The camera file and the masks are used where they are. Edits by hand
/// that concern the epoch are written for its halves. Same seed, same halves. The project file is written
/// last.
///
/// Source: the experiment of the paper, section 4.
///
/// # Errors
/// A cloud or the folder of photos cannot be read; the files of the halves cannot be written; an edit is in
/// metres and its file has no `facade`; interruption.
pub fn split(
    project: &Project,
    epoch: &Epoch,
    seed: u64,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Halves> {
    let photos = shuffled_photos(epoch, seed)?;
    if let (Some(files), 0..2) = (&epoch.photos, photos.len()) {
        let message = format!(
            "posed photos in it: {}; two at least are needed to split an epoch",
            photos.len()
        );
        return Err(Error::Input {
            path: files.images.clone(),
            message,
        });
    }

    let edits = halves_edits(project, epoch, &photos, &out.join(EDITS))?;
    let mut text = head(project, epoch)?;
    for half in 0..2 {
        if let Some(files) = &epoch.photos {
            copy_photos(&photos, &files.images, half, out, progress)?;
        }
        let clouds = write_clouds(epoch, half, seed, out, progress)?;
        text += &epoch_table(epoch, half, &clouds)?;
    }

    text.push_str(
        "# motion = { kind = \"translation\", d = [0.0, 0.02, 0.05] }   # moves the points of half 2 after labelling\n",
    );
    let mut left_out = Vec::new();

    if let Some(edits) = edits {
        edits.file.write()?;
        let _ = write!(text, "\n[edits]\nfile = {}\n", quoted(EDITS));
        left_out = edits.left_out;
    }

    let path = out.join("stonewise.toml");
    write_text(&path, &text)?;
    Ok(Halves {
        project: path,
        left_out,
    })
}

fn head(project: &Project, epoch: &Epoch) -> Result<String> {
    let name = quoted(&format!("{}, {} split", project.name, epoch.name));
    let mut text = format!("[project]\nname = {name}\n");
    if let Some(crs) = &epoch.map.crs {
        let _ = writeln!(text, "crs = {}", quoted(crs));
    }
    if epoch.map.false_origin != [0.0; 3] {
        let _ = writeln!(text, "false_origin = {:?}", epoch.map.false_origin);
    }
    if let Some(geoid) = &epoch.map.geoid {
        let _ = writeln!(text, "geoid = {}", absolute(geoid)?);
    }
    Ok(text)
}

fn epoch_table(epoch: &Epoch, half: usize, clouds: &[String]) -> Result<String> {
    let clouds: Vec<String> = clouds.iter().map(|name| quoted(name)).collect();
    let mut text = format!(
        "\n[[epochs]]\nname = {}\nclouds = [{}]\n",
        quoted(&half_name(half)),
        clouds.join(", ")
    );
    if let Some(files) = &epoch.photos {
        let (folder, cameras) = (half_folder(half), absolute(&files.cameras)?);
        let _ = writeln!(text, "images = \"{folder}/images\"\ncameras = {cameras}");
    }
    if epoch.photo_choice == PhotoChoice::All {
        text.push_str("photos = \"all\"\n");
    }
    if let Some(masks) = &epoch.masks {
        let _ = writeln!(text, "masks = {}", absolute(masks)?);
    }
    if half == 1 {
        let _ = writeln!(
            text,
            "same_survey_as = {}   # the same stations and strips, with the same errors",
            quoted(&half_name(0))
        );
    }
    Ok(text)
}

/// The clouds of a half, as the new project names them.
fn write_clouds(
    epoch: &Epoch,
    half: usize,
    seed: u64,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Vec<String>> {
    let mut names = Vec::new();
    let folder = out.join(half_folder(half));
    fs::create_dir_all(&folder).map_err(Error::io("making a folder", &folder))?;
    for (number, cloud) in epoch.clouds.iter().enumerate() {
        let name = format!("{}/cloud_{}.laz", half_folder(half), number + 1);
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
        names.push(name);
    }
    Ok(names)
}

fn absolute(path: &Path) -> Result<String> {
    let path = dunce::canonicalize(path).map_err(Error::io("finding", path))?;
    Ok(quoted(&path.to_string_lossy()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scans::ScansProject;
    use stonewise_core::epoch::EpochId;
    use stonewise_core::progress::Silent;

    #[test]
    fn scans_alone_are_divided_too() {
        let dir = tempfile::tempdir().unwrap();
        let scans = ["a.xyz", "b.xyz"].map(|name| dir.path().join(name));
        let points: String = (0..1000).map(|i| format!("{i} 0 1\n")).collect();
        for scan in &scans {
            fs::write(scan, &points).unwrap();
        }
        let project = ScansProject::new(&scans, dir.path()).unwrap().project;
        let out = dir.path().join("halves");
        fs::create_dir(&out).unwrap();
        split(&project, &project.epochs[EpochId::REFERENCE], 1, &out, &Silent).unwrap();
        let points = ["half1", "half2"].map(|half| {
            let cloud = out.join(half).join("cloud_1.laz");
            claimed_records(&cloud).unwrap().unwrap()
        });
        assert_eq!(points.iter().sum::<u64>(), 1000);
        assert!(points.iter().all(|p| *p > 400), "{points:?}");
    }
}
