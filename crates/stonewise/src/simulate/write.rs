//! A simulated survey as a folder.

use crate::simulate::photos::write_photos;
use crate::simulate::project_file::project_text;
use crate::simulate::truth::{Seen, SeenByScans, write_stone_table};
use crate::simulate::unfinished::Unfinished;
use crate::simulate::{SimulateError, SurveyParams};
use nalgebra::Point3;
use std::path::{Path, PathBuf};
use stonewise_core::geometry::Bounds;
use stonewise_core::progress::Progress;
use stonewise_core::simulate::{
    FacePoint, SampledFaces, Scan, SeenCells, Sensor, StoneTruth, Window, World, scan_window, stone_truths,
    window_truths,
};
use stonewise_io::atomic::write_atomically;
use stonewise_io::cloud::{ExtraColumn, ExtraType, PointSink, stream_points_laz};

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
/// - `stonewise.toml` (and `stonewise_uav.toml` where there are both kinds of cloud), `simulation.toml` (the parameters)
/// - `epoch1/`, `epoch2/`: `cloud_tls.laz`, `cloud_uav.laz`, `images/*.jpg`, `cameras_metashape.xml`
/// - `masks/epoch1.json`, ... (or `masks/epoch1/`): true outlines, numbered at random in every photo
/// - `truth/`: `stones.csv`, clouds with `stone_id` in the same order, exact cameras, and which stone each mask is
///
/// The section is worked on piece by piece and photo by photo: memory does not grow with the number of points. Masks as COCO
/// json stay in memory until the epoch is done.
///
/// Every file appears whole or not at all, and the project file last: without it the survey is not complete. An interrupted
/// simulation goes on with the same parameters: clouds of an epoch, and photos whose masks are PNGs, are not made again.
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

/// One epoch that is being written.
pub(super) struct Survey<'a> {
    pub folder: &'a Path,
    pub world: &'a World,
    pub params: &'a SurveyParams,
    /// 0 or 1.
    pub epoch: usize,
    pub unfinished: &'a Unfinished,
    pub progress: &'a dyn Progress,
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

impl Survey<'_> {
    /// Number of the epoch in names of files.
    pub fn number(&self) -> usize {
        self.epoch + 1
    }

    /// The clouds of both scanners, written unless they are there; gives back what they saw. `truths`: of all stones, filled in
    /// by whoever needs them first.
    fn scanned(&self, truths: &mut Option<Vec<StoneTruth>>) -> Result<SeenByScans, SimulateError> {
        let part = format!("epoch{}_clouds.json", self.number());
        if let Some(seen) = self.unfinished.read(&part) {
            truths.get_or_insert_with(|| stone_truths(self.world));
            return Ok(seen);
        }
        create_folder(&self.folder.join(format!("epoch{}", self.number())))?;
        let seen = self.write_clouds(truths)?;
        self.unfinished.write(&part, &seen)?;
        Ok(seen)
    }

    /// Scans the section piece by piece with both scanners into `cloud_SENSOR.laz`, and the same points in the same order,
    /// with the true stone of each, into the truth.
    fn write_clouds(&self, truths: &mut Option<Vec<StoneTruth>>) -> Result<SeenByScans, SimulateError> {
        let extent = self.world.wall.extent();
        let windows = Window::cover(extent);
        let mut seen = Sensor::ALL.map(|_| SeenCells::new(self.world, self.epoch));
        let (mut found, mut sampled) = (Vec::new(), SampledFaces::default());
        let mut total = 0;
        self.progress
            .begin(&format!("scans of epoch {}", self.number()), windows.len() as u64);
        self.with_files(Sensor::Tls, |tls| {
            self.with_files(Sensor::Uav, |uav| {
                let mut files = [tls, uav];
                for window in &windows {
                    self.progress.check()?;
                    let part = window.surroundings(extent);
                    let surface = self.world.next_surface(part, &mut sampled);
                    let scene = self.world.scene_of(&surface, self.epoch);
                    if self.epoch == 0 && truths.is_none() {
                        found.extend(window_truths(self.world, &scene, window));
                    }
                    for ((sensor, append), seen) in Sensor::ALL.into_iter().zip(&mut files).zip(&mut seen) {
                        let scan = scan_window(&scene, &self.params.scene, sensor, self.epoch, window);
                        if let (Some(scan), Some(append)) = (scan, append) {
                            seen.add(&scan);
                            total += scan.len();
                            append(&scan)?;
                        }
                    }
                    self.progress.advance(1);
                }
                Ok(())
            })
        })?;
        found.sort_by_key(|t: &StoneTruth| t.id);
        let truths = truths.get_or_insert(found);
        Ok(SeenByScans {
            total,
            points: seen.each_ref().map(|s| s.points().to_vec()),
            cells: seen.each_ref().map(|s| s.cells(truths)),
        })
    }

    /// Opens the files of a scanner's cloud and lends what appends to them, or `None` where the survey has no such scanner.
    fn with_files(
        &self,
        sensor: Sensor,
        write: impl FnOnce(Option<Append<'_>>) -> Result<(), SimulateError>,
    ) -> Result<(), SimulateError> {
        let wanted = match sensor {
            Sensor::Tls => self.params.scene.tls.is_some(),
            Sensor::Uav => self.params.scene.uav.is_some(),
        };
        if !wanted {
            return write(None);
        }
        let (name, number) = (sensor.name(), self.number());
        let path = self.folder.join(format!("epoch{number}/cloud_{name}.laz"));
        let truth = self
            .folder
            .join(format!("truth/epoch{number}_cloud_{name}_truth.laz"));
        let bounds = self.bounds();
        let columns = [("stone_id", ExtraType::U32), ("station", ExtraType::U16)];
        stream_points_laz(&path, &bounds, &[], |cloud| {
            stream_points_laz(&truth, &bounds, &columns, |known| {
                write(Some(Box::new(|scan| append(cloud, known, scan))))
            })
        })
    }

    /// A box that holds all that scanners can measure.
    fn bounds(&self) -> Bounds {
        const AROUND_M: f64 = 3.0;
        let scene = &self.params.scene;
        let margins = [
            scene.tls.as_ref().map(|t| t.margin_m),
            scene.uav.as_ref().map(|u| u.margin_m),
        ];
        let margin = margins.iter().flatten().fold(0.0, |m: f64, v| m.max(*v));
        let [a0, a1, u0, u1] = self.world.wall.extent();
        let corners = (0..=64).flat_map(|i| {
            let a = a0 + (a1 - a0) * f64::from(i) / 64.0;
            [u0, u1].map(|u| self.world.wall.face.world_of(&FacePoint { a, u, n: 0.0 }))
        });
        let origin = Point3::origin();
        let around = Bounds::of(corners).unwrap_or(Bounds {
            min: origin,
            max: origin,
        });
        around.grown(margin + AROUND_M)
    }
}

/// Appends what was scanned to the files of a cloud.
type Append<'a> = Box<dyn FnMut(&Scan) -> Result<(), SimulateError> + 'a>;

fn append(cloud: &mut PointSink<'_>, known: &mut PointSink<'_>, scan: &Scan) -> Result<(), SimulateError> {
    let positions: Vec<Point3<f64>> = (0..scan.len()).map(|i| scan.cloud.world(i)).collect();
    let columns = [ExtraColumn::U32(&scan.stone), ExtraColumn::U16(&scan.station)];
    let (measured, truth) = rayon::join(
        || cloud.append(&positions, &[]),
        || known.append(&positions, &columns),
    );
    measured?;
    Ok(truth?)
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
