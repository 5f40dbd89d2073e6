//! A simulated survey as a folder.

use crate::simulate::photos::write_photos;
use crate::simulate::project_file::project_text;
use crate::simulate::truth::{count_seen, write_stone_table};
use crate::simulate::{SimulateError, SurveyParams};
use nalgebra::Point3;
use std::path::{Path, PathBuf};
use stonewise_core::progress::Progress;
use stonewise_core::simulate::{EpochScans, Scan, World, stone_truths};
use stonewise_io::atomic::write_atomically;
use stonewise_io::cloud::{ExtraColumn, write_points_laz};

/// What was written.
#[derive(Clone, Debug, PartialEq)]
pub struct SurveySummary {
    /// The project file: terrestrial clouds where there are any, else the drone's.
    pub project: PathBuf,
    /// A second project file that uses the drone's clouds, where there are both.
    pub project_uav: Option<PathBuf>,
    /// The true motion of every stone.
    pub truth: PathBuf,
    /// Number of stones.
    pub stones: usize,
    /// Number of points, all clouds together.
    pub points: usize,
    /// Number of photos, both epochs together.
    pub photos: usize,
}

/// Simulates a survey of two epochs and writes it into `folder`, which is made where it is missing:
///
/// - `stonewise.toml` (and `stonewise_uav.toml` where there are both kinds of cloud), `simulation.toml` (the parameters)
/// - `epoch1/`, `epoch2/`: `cloud_tls.laz`, `cloud_uav.laz`, `images/*.jpg`, `cameras_metashape.xml`
/// - `masks/epoch1.json`, ...: true outlines, numbered at random in every photo
/// - `truth/`: `stones.csv`, clouds with `stone_id` in the same order, exact cameras, masks with `stone_id`
///
/// Every file appears whole or not at all, and the project file last: without it the survey is not complete.
///
/// # Errors
/// A parameter is impossible, the folder holds somebody's project, a file cannot be written, or the caller stops it.
pub fn write_survey(
    folder: &Path,
    params: &SurveyParams,
    progress: &dyn Progress,
) -> Result<SurveySummary, SimulateError> {
    params.check()?;
    prepare(folder)?;
    let photos = (params.photos.columns * params.photos.rows) as usize;
    progress.begin("simulate", 2 * (2 + photos as u64));
    let world = World::new(&params.scene);
    let truths = stone_truths(&world);
    let (mut seen, mut points) = (Vec::new(), 0);
    for epoch in 0..2 {
        progress.check()?;
        let scans = world.scan(&params.scene, epoch);
        progress.advance(1);
        points += write_clouds(folder, &scans, epoch + 1)?;
        progress.advance(1);
        let labels = write_photos(folder, &world.scene(epoch), params, epoch, progress)?;
        seen.push(count_seen(&world, &truths, &scans, &labels, epoch));
    }
    let truth = folder.join("truth/stones.csv");
    if let Ok(seen) = <[_; 2]>::try_from(seen) {
        write_stone_table(&truth, &truths, &seen)?;
    }
    write_text(&folder.join("simulation.toml"), &toml::to_string(params)?)?;
    let (project, project_uav) = write_projects(folder, params)?;
    Ok(SurveySummary {
        project,
        project_uav,
        truth,
        stones: truths.len(),
        points,
        photos: 2 * photos,
    })
}

/// Makes a folder and those above it.
pub(super) fn create_folder(path: &Path) -> Result<(), SimulateError> {
    std::fs::create_dir_all(path).map_err(|source| SimulateError::Write {
        path: path.to_owned(),
        source,
    })
}

/// Takes an earlier simulation's project file away, so that an interrupted run is not taken for a complete survey.
fn prepare(folder: &Path) -> Result<(), SimulateError> {
    let project = folder.join("stonewise.toml");
    if project.exists() {
        if !folder.join("simulation.toml").exists() {
            return Err(SimulateError::Occupied {
                path: folder.to_owned(),
            });
        }
        std::fs::remove_file(&project).map_err(|source| SimulateError::Write {
            path: project,
            source,
        })?;
    }
    create_folder(&folder.join("truth"))
}

fn write_clouds(folder: &Path, scans: &EpochScans, number: usize) -> Result<usize, SimulateError> {
    let mut points = 0;
    create_folder(&folder.join(format!("epoch{number}")))?;
    for (sensor, scan) in [("tls", &scans.tls), ("uav", &scans.uav)] {
        let Some(scan) = scan else { continue };
        points += scan.len();
        let positions: Vec<Point3<f64>> = (0..scan.len()).map(|i| scan.cloud.world(i)).collect();
        let path = folder.join(format!("epoch{number}/cloud_{sensor}.laz"));
        write_points_laz(&path, &positions, &[])?;
        write_true_cloud(folder, &positions, scan, sensor, number)?;
    }
    Ok(points)
}

/// The same points in the same order, with the true stone of each.
fn write_true_cloud(
    folder: &Path,
    positions: &[Point3<f64>],
    scan: &Scan,
    sensor: &str,
    number: usize,
) -> Result<(), SimulateError> {
    let path = folder.join(format!("truth/epoch{number}_cloud_{sensor}_truth.laz"));
    let columns = [
        ("stone_id", ExtraColumn::U32(&scan.stone)),
        ("station", ExtraColumn::U16(&scan.station)),
    ];
    Ok(write_points_laz(&path, positions, &columns)?)
}

fn write_projects(folder: &Path, params: &SurveyParams) -> Result<(PathBuf, Option<PathBuf>), SimulateError> {
    let both = params.scene.tls.is_some() && params.scene.uav.is_some();
    let main = if params.scene.tls.is_some() { "tls" } else { "uav" };
    let uav = folder.join("stonewise_uav.toml");
    if both {
        write_text(&uav, &project_text(params, "uav")?)?;
    }
    let project = folder.join("stonewise.toml");
    write_text(&project, &project_text(params, main)?)?;
    Ok((project, both.then_some(uav)))
}

fn write_text(path: &Path, text: &str) -> Result<(), SimulateError> {
    write_atomically(path, |partial| std::fs::write(partial, text)).map_err(|source| SimulateError::Write {
        path: path.to_owned(),
        source,
    })
}
