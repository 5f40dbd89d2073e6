//! A simulated survey as a folder.

use crate::files::photos::write_photos;
use crate::files::project_file::project_text;
use crate::files::survey::{Survey, create_folder};
use crate::files::truth::{Seen, write_stone_table};
use crate::files::unfinished::Unfinished;
use crate::files::{SimulateError, SurveyParams};
use crate::world::World;
use std::path::{Path, PathBuf};
use stonewise_core::progress::Progress;
use stonewise_io::atomic::write_atomically;

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

/// Simulates a survey of one or two epochs and writes it into `folder`, which is made where it is missing:
///
/// - `stonewise.toml` (and `stonewise_uav.toml` where there are both kinds of cloud), `simulation.toml` (the
///   parameters)
/// - `epoch1/`, `epoch2/`: `cloud_tls.laz`, `cloud_uav.laz`, `images/*.jpg`, `cameras_metashape.xml`
/// - `masks/epoch1.json`, ... (or `masks/epoch1/`): true outlines, numbered at random in every photo
/// - `truth/`: `stones.csv`, clouds with `stone_id` in the same order, exact cameras, and which stone each
///   mask is
///
/// The section is worked on piece by piece and photo by photo: memory does not grow with the number of
/// points. Masks as COCO json stay in memory until the epoch is done.
///
/// Every file appears whole or not at all, and the project file last: without it the survey is not complete.
/// An interrupted simulation goes on with the same parameters: clouds of an epoch, and photos whose masks are
/// PNGs, are not made again.
///
/// # Errors
/// A parameter is impossible, the folder holds somebody's project, a file cannot be written, or the caller
/// stops it.
pub fn write_survey(
    folder: &Path,
    params: &SurveyParams,
    progress: &dyn Progress,
) -> Result<SurveySummary, SimulateError> {
    params.check()?;
    prepare(folder)?;
    let unfinished = Unfinished::open(folder, params)?;
    let photos = (params.photos.columns * params.photos.rows) as usize;
    let world = World::new(&params.scene);
    let mut truths = None;
    let (mut seen, mut points) = (Vec::new(), 0);

    for epoch in 0..params.epochs as usize {
        let survey = Survey {
            folder,
            world: &world,
            params,
            epoch,
            unfinished: &unfinished,
            progress,
        };
        let scans = survey.scanned(&mut truths)?;
        points += scans.total;
        seen.push(Seen {
            scans,
            photos: write_photos(&survey)?,
        });
    }

    let truths = truths.unwrap_or_default();
    let truth = folder.join("truth/stones.csv");
    write_stone_table(&truth, &truths, &seen)?;
    write_text(&folder.join("simulation.toml"), &toml::to_string(params)?)?;
    let (project, project_uav) = write_projects(folder, params)?;
    unfinished.remove()?;

    Ok(SurveySummary {
        project,
        project_uav,
        truth,
        stones: truths.len(),
        points,
        photos: params.epochs as usize * photos,
    })
}

/// Takes an earlier simulation's project file away, so that an interrupted run is not taken for a complete
/// survey.
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
