//! Predicts the accuracy of a planned survey: a plain wall is simulated, surveyed twice as planned, and
//! measured as any survey is.
//!
//! The wall stands still, so that the accuracy that the adjustment gives is that of a survey of such a
//! wall. The same is done with each candidate in addition; all share the wall and the errors of what is planned.

mod flights;
mod page;
mod plan_file;
mod planned;
mod squares;
mod values;

use crate::error::{Error, Result};
use crate::experiment::inner_work::InnerWork;
use crate::experiment::predicted::{limits_mm, medians_mm, without_chance};
use crate::experiment::simulation::not_simulated;
use crate::files::{write_readable_json, write_text};
use crate::pipeline::{Context, Run, Until};
use crate::project::Project;
use crate::results::{RowMotion, StoneRow, read_outlines};
use crate::storage::step::Key;
use crate::storage::store::{Keeps, StepStore};
pub use flights::{PlannedDrone, PlannedPhotos};
use page::page;
pub use plan_file::{PlannedInstrument, PlannedRegistration, PlannedStation, PlannedTargets, SurveyPlan};
pub use planned::{PlanDesign, PlannedSurvey};
use squares::Squares;
pub use squares::Weakest;
use std::path::Path;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::progress::Progress;
use stonewise_simulate::{
    MaskFiles, PhotoParams, SceneParams, SurroundingsParams, SurveyParams, TlsParams, Wall, write_survey,
};

/// How far a station may stand off its planned place, metres.
const PLACEMENT_M: f64 = 0.2;

/// Predicts what a planned survey will see, and with each candidate in addition; writes `design.json` and
/// `design.html` into `out`. An interrupted prediction goes on where it stopped.
///
/// # Errors
/// The plan describes no wall that can be built, a survey shows no stone, a file cannot be written, interruption.
pub fn design_plan(plan: &SurveyPlan, seed: u64, out: &Path, progress: &dyn Progress) -> Result<PlanDesign> {
    let store = Arc::new(StepStore::new(&out.join("work"), Keeps::Every)?);
    let candidates = plan.candidates();
    progress.begin("planned surveys", 1 + candidates.len() as u64);
    let wall = Wall::new(&simulation(plan, seed).scene.wall);
    let mut surveys = Vec::new();

    for added in std::iter::once(None).chain(candidates.iter().map(Some)) {
        let taking_part = plan.with(added.map(String::as_str));
        surveys.push(survey(&taking_part, added, seed, &wall, out, &store, progress)?);
        progress.advance(1);
    }

    let maps: Vec<(PlannedSurvey, Squares)> = {
        let mut with_candidate = surveys.split_off(1);
        with_candidate.sort_by(|a, b| a.1.order(&b.1));
        surveys.into_iter().chain(with_candidate).collect()
    };
    let mut each = maps.iter().map(|(survey, _)| survey.clone());
    let planned = each
        .next()
        .ok_or_else(|| Error::Survey("the plan has no survey".to_owned()))?;
    let design = PlanDesign {
        seed,
        planned,
        with_candidate: each.collect(),
    };
    write_readable_json(&out.join("design.json"), &design)?;
    write_text(&out.join("design.html"), &page(&maps))?;
    Ok(design)
}

/// Simulates two surveys of the still wall with all that the plan names, and measures them.
fn survey(
    plan: &SurveyPlan,
    added: Option<&String>,
    seed: u64,
    wall: &Wall,
    out: &Path,
    store: &Arc<StepStore>,
    progress: &dyn Progress,
) -> Result<(PlannedSurvey, Squares)> {
    let inner = InnerWork(progress);
    let name = added.map_or("as_planned".to_owned(), |name| format!("with_{name}"));
    let params = simulation(plan, seed);
    let (dir, _) = store.step("survey", Key::new("survey", &params, &[]), &[], |dir| {
        let written = write_survey(&dir.file("survey"), &params, &inner);
        written.map(drop).map_err(not_simulated)
    })?;
    let project = project(plan, &dir.file("survey"))?;
    let folder = out.join(&name);
    let context = Context::with_store(&project, &folder, Arc::clone(store), &inner)?;
    let (run, later) = (Run::new(&context, Until::Registered), EpochId::at(1));
    let (registered, measured) = (run.registered(later)?, run.measured(later)?);
    let deformation = registered.deformation.as_ref();
    let rows = without_chance(&measured.rows, deformation, &read_outlines(&folder)?);
    let found: Vec<(&StoneRow, &RowMotion)> = { rows.iter() }
        .filter_map(|row| Some((row, row.motion.as_ref()?)))
        .collect();
    if found.is_empty() {
        return Err(Error::Survey(format!(
            "{name}: no stone is measured; are the stations and strips in front of the wall, and is the \
             point spacing small enough?"
        )));
    }

    let squares = Squares::new(wall, plan.square_m, &found);
    let summary = PlannedSurvey {
        stations: plan.stations.iter().map(|s| s.name.clone()).collect(),
        drone: plan.drone.is_some(),
        photos: match plan.photos {
            Some(_) => params.photos.columns * params.photos.rows,
            None => 0,
        },
        targets: plan.targets.is_some(),
        added: added.cloned(),
        stones: [squares.stones(), found.len()],
        datum: measured.datum.state,
        sd_mm: medians_mm(&found, |(_, m), axis| Some(m.face_sd[axis])),
        sd_deformation_mm: medians_mm(&found, |(_, m), axis| m.deformation_sd[axis]),
        zones_mm: limits_mm(deformation, |d| d.detection_limits_m),
        zones_in_face_mm: limits_mm(deformation, |d| d.limits_in_face_m),
        squares: [squares.count(), squares.unseen()],
        weakest: squares.weakest(),
    };
    Ok((summary, squares))
}

/// The project of a simulated survey, with what the plan states about its errors.
pub(super) fn project(plan: &SurveyPlan, folder: &Path) -> Result<Project> {
    let mut project = Project::read(&folder.join("stonewise.toml"))?;
    let registration = &mut project.settings.registration;
    registration.photos.enabled = plan.photos.is_some();
    if let Some(error_px) = plan.photos.as_ref().and_then(|p| p.pose_error_px) {
        registration.photos.pose_error_px = error_px;
    }
    // Of a wall that stands still, only what is known of the frame counts, not how far off it was.
    registration.epoch_error_m = plan.targets.as_ref().map(|t| t.error_m);
    match &plan.drone {
        Some(drone) if plan.stations.is_empty() => registration.observers.shared_error_m = drone.datum_m,
        // The simulator's project names the cloud of the stations alone.
        Some(_) => {
            for number in 1..=2 {
                let cloud = folder.join(format!("epoch{number}/cloud_uav.laz"));
                project.epochs[EpochId::at(number - 1)].clouds.push(cloud);
            }
        }
        None => (),
    }
    Ok(project)
}

/// The survey that a plan describes, of a wall that stands still.
pub(super) fn simulation(plan: &SurveyPlan, seed: u64) -> SurveyParams {
    let stations = TlsParams {
        registration_m: plan.registration.shift_m,
        registration_rad: plan.registration.rotation_rad,
        placement_m: PLACEMENT_M,
        places: plan.stations.iter().map(|s| plan.place(s)).collect(),
        ..TlsParams::default()
    };
    let size_m = [plan.wall.width_m, plan.wall.height_m];
    SurveyParams {
        name: "Planned survey".to_owned(),
        masks: MaskFiles::Png,
        scene: SceneParams {
            wall: plan.wall.clone(),
            surroundings: SurroundingsParams::none(),
            tls: (!plan.stations.is_empty()).then_some(stations),
            uav: plan.drone.as_ref().map(PlannedDrone::params),
            ..SceneParams::default()
        }
        .seeded(seed),
        photos: match &plan.photos {
            Some(photos) => photos.params(size_m),
            None => PhotoParams {
                rendered: false,
                ..PlannedPhotos::that_find().params(size_m)
            },
        },
        ..SurveyParams::default()
    }
}
