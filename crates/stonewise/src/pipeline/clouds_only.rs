//! Comparing clouds without stones: M3C2, C2C and C2M as commands of their own.

use crate::error::{Error, Result};
use crate::output::OutputFolder;
use crate::pipeline::agenda::Agenda;
use crate::pipeline::context::Context;
use crate::pipeline::graph::{Run, Task};
use crate::pipeline::outputs::crs::coordinate_system;
use crate::pipeline::outputs::m3c2::write_m3c2;
use crate::pipeline::outputs::m3c2_recipes::write_m3c2_recipes;
use crate::pipeline::steps::ingest::{INGEST, Ingested, scanners};
use crate::pipeline::steps::m3c2::{change_field, m3c2};
use crate::pipeline::until::Until;
use crate::project::Project;
use crate::warnings::Warning;
use nalgebra::Point3;
use std::path::Path;
use stonewise_core::change::{MeshIndex, OutwardReference, PointDistances, c2c_survey, c2m_survey};
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::geometry::View;
use stonewise_core::progress::Progress;
use stonewise_core::surface::{Outside, SURE_OF_OUTSIDE, oriented_surface};
use stonewise_io::cloud::{Dimension, ExtraColumn, read_mesh, write_points_laz};

/// Name of the comparison along normals, which a run of the project finds.
const M3C2: &str = "m3c2-2";
/// Names of the steps that leave nothing for later runs.
const C2C: &str = "c2c";
const C2M: &str = "c2m";
const C2C_DISTANCE: Dimension = Dimension::new("c2c_distance", "m", "distance to nearest point");
const C2M_DISTANCE: Dimension = Dimension::new("c2m_distance", "m", "distance to the mesh");

/// Edge of the cells in which the outside of a surface is found, metres: about a stone with its joints.
const CELL_M: f64 = 0.25;

/// What to compare with what.
#[derive(Clone, Copy, Debug)]
pub enum Comparison<'a> {
    /// Epochs along the normals of the first: `m3c2.laz`, `m3c2.csv`.
    M3c2 {
        /// Whether to write files with which CloudCompare and PDAL repeat it.
        recipes: bool,
    },
    /// Each point of the second epoch with the nearest of the first: `c2c.laz` with `c2c_distance`.
    C2c {
        /// Farther points have no distance, metres.
        max_m: f64,
    },
    /// Each point of the second epoch with a mesh: `c2m.laz` with `c2m_distance`, positive on the side of the
    /// faces' normals.
    C2m {
        /// The mesh, PLY.
        mesh: &'a Path,
        /// Farther points have no distance, metres.
        max_m: f64,
    },
}

/// Compares the first two epochs of a project in an output folder; neither photos nor masks are needed. `below`: where
/// in the folder the files go; [`DATA_DIR`](crate::results::names::DATA_DIR) beside other results.
///
/// M3C2's normals point at the cameras of the first epoch where it has any. Else they point outside as scanner
/// positions or the surface itself say; the returned warnings hold a doubt where these do not say it clearly.
///
/// # Errors
/// A cloud, the mesh or a camera file cannot be read; a result cannot be written; interruption.
pub fn compare_clouds(
    project: &Project,
    what: Comparison,
    folder: &OutputFolder,
    below: &Path,
    progress: &dyn Progress,
) -> Result<Vec<Warning>> {
    let later = EpochId::at(1);
    let mut context = Context::new(project, folder, progress)?;
    context.agenda = match what {
        Comparison::M3c2 { .. } => agenda(project, &[EpochId::REFERENCE, later], M3C2, "M3C2"),
        Comparison::C2c { .. } => agenda(project, &[EpochId::REFERENCE, later], C2C, "C2C"),
        Comparison::C2m { .. } => agenda(project, &[later], C2M, "C2M"),
    };
    context.agenda.announce(progress);
    let run = Run::new(&context, Until::Compared);
    let out = &folder.path().join(below);
    match what {
        Comparison::M3c2 { recipes } => {
            let first = run.clouds(later)?.first;
            let views = views_of(project)?;
            let centres: Vec<Point3<f64>> = views.iter().map(View::centre).collect();
            let outside = match centres.is_empty() {
                true => Some(outside_of(&context, &first)?),
                false => None,
            };
            let outward = match &outside {
                Some(outside) => OutwardReference::Surface(outside),
                None => OutwardReference::Towards(&centres),
            };
            let change = change_field(&context.in_line(M3C2, || m3c2(&run, later, &outward))?)?;
            write_m3c2(out, later, coordinate_system(project)?.as_ref(), &change)?;
            if recipes {
                let clouds = [EpochId::REFERENCE, later].map(|epoch| project.epochs[epoch].clouds.as_slice());
                write_m3c2_recipes(out, clouds, &project.settings.m3c2, &change)?;
            }
        }
        Comparison::C2c { max_m } => {
            let Pair { first, later } = run.clouds(later)?;
            let compare = || {
                let found = c2c_survey(&first.tiles, &later.tiles, max_m, progress)?;
                write_distances(&found, project, &out.join("c2c.laz"), C2C_DISTANCE)
            };
            context.in_line(C2C, || context.timed(C2C, compare))?;
        }
        Comparison::C2m { mesh, max_m } => {
            let later = run.ingested(later)?;
            let compare = || {
                let index = MeshIndex::new(read_mesh(mesh)?);
                let found = c2m_survey(&index, &later.tiles, max_m, progress)?;
                write_distances(&found, project, &out.join("c2m.laz"), C2M_DISTANCE)
            };
            context.in_line(C2M, || context.timed(C2M, compare))?;
        }
    }
    Ok(context.warnings.sorted())
}

/// The outside of the first epoch's surface; reports what it follows from, and notes a doubt where that is weak.
fn outside_of(context: &Context, first: &Ingested) -> Result<Outside> {
    let epoch = context.project.epochs.reference();
    let scanners = scanners(epoch)?;
    let tiles = &first.tiles.surveyed;
    let found = oriented_surface::<_, Error>(tiles, CELL_M, &scanners, context.progress)?;
    let evidence = found.evidence;
    let reason = match scanners.len() {
        0 => format!(
            "no camera or scanner position says which side is outside; level surfaces, joints and batter do by {:.1}, {:.1} and \
             {:.1}, and three fifths of the walls are turned by {:.1} at least (logarithms of the odds; {SURE_OF_OUTSIDE} is sure)",
            evidence.level, evidence.joints, evidence.batter, found.odds
        ),
        1 => "normals point to the side of the scanner".to_owned(),
        n => format!("normals point to the side of the {n} scanner positions"),
    };
    if found.is_sure() {
        context.progress.note(&reason);
    } else {
        let message = format!(
            "{reason}: all distances may have the wrong sign. Compare the normals in m3c2.laz with the wall, or give a project \
             with cameras"
        );
        context.warnings.doubt("m3c2", &epoch.name, message);
    }
    Ok(Outside::of(&found.cells))
}

/// The clouds of these epochs are cut into tiles, then comes a step of this name.
fn agenda(project: &Project, epochs: &[EpochId], name: &str, words: &str) -> Agenda {
    let step = &INGEST;
    let ingest = epochs.iter().map(|&epoch| Task { step, epoch });
    let lines = ingest.filter_map(|task| Some((task.id(), task.words(project)?)));
    Agenda::of(lines.chain([(name.to_owned(), words.to_owned())]))
}

/// Cuts the clouds of all epochs of a project into tiles, as the first step of a run; the number of their
/// points.
///
/// # Errors
/// A cloud cannot be read, tiles cannot be written, interruption.
pub fn tile_clouds(project: &Project, folder: &OutputFolder, progress: &dyn Progress) -> Result<u64> {
    let context = Context::new(project, folder, progress)?;
    let run = Run::new(&context, Until::Segmented);
    let points = |epoch| Ok(run.ingested(epoch)?.tiles.surveyed.point_count());
    project.epochs.ids().map(points).sum()
}

fn views_of(project: &Project) -> Result<Vec<View>> {
    match project.epochs.first() {
        Some(epoch) => Ok(epoch.read_cameras()?.views),
        _ => Ok(Vec::new()),
    }
}

/// Writes points with their distances; NaN where there is none.
fn write_distances(
    found: &PointDistances,
    project: &Project,
    path: &Path,
    dimension: Dimension,
) -> Result<()> {
    if found.distances_m.iter().all(Option::is_none) {
        return Err(Error::Survey(
            "no point lies near enough to the reference: are both in one frame?".into(),
        ));
    }
    let crs = coordinate_system(project)?.map(|c| c.text());
    let distances: Vec<f64> = found.distances_m.iter().map(|d| d.unwrap_or(f64::NAN)).collect();
    Ok(write_points_laz(
        path,
        crs.as_deref(),
        &found.points,
        &[(dimension, ExtraColumn::F64(&distances))],
    )?)
}
