//! What a survey will see that is only planned: a plain wall is simulated, scanned twice from the planned stations, and
//! measured as any survey is.
//!
//! The wall stands still, so that what the adjustment says of its accuracy is what a survey of such a wall will have. The
//! same is done with each candidate as one more station; all share the wall and the errors of the stations before it.

mod page;
mod plan_file;
mod planned;
mod squares;

use crate::error::{Error, Result};
use crate::experiment::predicted::{limits_mm, medians_mm, without_chance};
use crate::experiment::quiet::Quiet;
use crate::files::{write_readable_json, write_text};
use crate::pipeline::{Context, Run, Until};
use crate::project::Project;
use crate::results::{RowMotion, StoneRow, read_outlines};
use crate::storage::step::Key;
use crate::storage::store::{Keeps, StepStore};
use page::page;
pub use plan_file::{PlannedInstrument, PlannedRegistration, PlannedStation, SurveyPlan};
pub use planned::{PlanDesign, PlannedSurvey};
use squares::Squares;
pub use squares::Weakest;
use std::path::Path;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::progress::Progress;
use stonewise_simulate::{
    MaskFiles, PhotoParams, SceneParams, SimulateError, SurroundingsParams, SurveyParams, TlsParams, Wall,
    write_survey,
};

/// How far a station may stand off its planned place, metres.
const PLACEMENT_M: f64 = 0.2;
/// Distance of the photos from the face and from each other along and up, metres.
const PHOTO_M: [f64; 3] = [8.0, 4.0, 3.0];

/// Predicts what the stations of a plan will see, and with each candidate in addition; writes `design.json` and
/// `design.html` into `out`. An interrupted prediction goes on where it stopped.
///
/// # Errors
/// The plan describes no wall that can be built, a survey shows no stone, a file cannot be written, interruption.
pub fn design_plan(plan: &SurveyPlan, seed: u64, out: &Path, progress: &dyn Progress) -> Result<PlanDesign> {
    let store = Arc::new(StepStore::new(&out.join("work"), Keeps::Every)?);
    let candidates: Vec<&PlannedStation> = plan.stations.iter().filter(|s| s.candidate).collect();
    progress.begin("planned surveys", 1 + candidates.len() as u64);
    let wall = Wall::new(&scene(plan, None, seed).wall);
    let mut surveys = Vec::new();

    for added in std::iter::once(None).chain(candidates.into_iter().map(Some)) {
        surveys.push(survey(plan, added, seed, &wall, out, &store, progress)?);
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
        .ok_or_else(|| Error::Survey("a plan without stations".to_owned()))?;
    let design = PlanDesign {
        seed,
        planned,
        with_candidate: each.collect(),
    };
    write_readable_json(&out.join("design.json"), &design)?;
    write_text(&out.join("design.html"), &page(&maps))?;
    Ok(design)
}

/// Simulates two surveys of the still wall and measures them.
fn survey(
    plan: &SurveyPlan,
    added: Option<&PlannedStation>,
    seed: u64,
    wall: &Wall,
    out: &Path,
    store: &Arc<StepStore>,
    progress: &dyn Progress,
) -> Result<(PlannedSurvey, Squares)> {
    let quiet = Quiet(progress);
    let name = added.map_or("as_planned".to_owned(), |s| format!("with_{}", s.name));
    let params = simulation(plan, added, seed);
    let (dir, _) = store.step("survey", Key::new("survey", &params, &[]), &[], |dir| {
        let written = write_survey(&dir.file("survey"), &params, &quiet);
        written.map(drop).map_err(|error| match error {
            SimulateError::Interrupted(_) => Error::Interrupted,
            error => Error::Simulate(error.into()),
        })
    })?;
    let mut project = Project::read(&dir.file("survey").join("stonewise.toml"))?;
    // The photos show nothing but where stones are.
    project.settings.registration.photos.enabled = false;
    let folder = out.join(&name);
    let context = Context::with_store(&project, &folder, Arc::clone(store), &quiet)?;
    let (run, later) = (Run::new(&context, Until::Registered), EpochId::at(1));
    let (registered, measured) = (run.registered(later)?, run.measured(later)?);
    let deformation = registered.deformation.as_ref();
    let rows = without_chance(&measured.rows, deformation, &read_outlines(&folder)?);
    let found: Vec<(&StoneRow, &RowMotion)> = { rows.iter() }
        .filter_map(|row| Some((row, row.motion.as_ref()?)))
        .collect();
    if found.is_empty() {
        return Err(Error::Survey(format!(
            "{name}: no stone is measured; do the stations stand in front of the wall, with beams near enough to each other?"
        )));
    }

    let squares = Squares::new(wall, plan.square_m, &found);
    let summary = PlannedSurvey {
        stations: stations(plan, added).map(|s| s.name.clone()).collect(),
        added: added.map(|s| s.name.clone()),
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

/// The stations of the plan, and one candidate after them.
fn stations<'a>(
    plan: &'a SurveyPlan,
    added: Option<&'a PlannedStation>,
) -> impl Iterator<Item = &'a PlannedStation> {
    plan.stations.iter().filter(|s| !s.candidate).chain(added)
}

fn scene(plan: &SurveyPlan, added: Option<&PlannedStation>, seed: u64) -> SceneParams {
    SceneParams {
        wall: plan.wall.clone(),
        surroundings: SurroundingsParams::none(),
        tls: Some(TlsParams {
            registration_m: plan.registration.shift_m,
            registration_rad: plan.registration.rotation_rad,
            placement_m: PLACEMENT_M,
            places: stations(plan, added).map(|s| plan.place(s)).collect(),
            ..TlsParams::default()
        }),
        ..SceneParams::default()
    }
    .seeded(seed)
}

fn simulation(plan: &SurveyPlan, added: Option<&PlannedStation>, seed: u64) -> SurveyParams {
    let [distance_m, along_m, up_m] = PHOTO_M;
    let count = |size_m: f64, step_m: f64| (size_m / step_m).ceil().clamp(2.0, 1e3) as u32;
    SurveyParams {
        name: "Planned survey".to_owned(),
        masks: MaskFiles::Png,
        scene: scene(plan, added, seed),
        photos: PhotoParams {
            columns: count(plan.wall.width_m, along_m),
            rows: count(plan.wall.height_m, up_m),
            width: 1200,
            height: 900,
            focal_px: 1200.0,
            distance_m,
            rendered: false,
            ..PhotoParams::default()
        },
        ..SurveyParams::default()
    }
}
