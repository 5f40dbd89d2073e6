//! The paper's experiment, section 4 and 5: one epoch split into halves, the second moved, every figure and
//! table again.

mod case;
mod detectors;
mod figure_5;
mod figures;
mod options;
mod outcome;
mod page;
mod tables;

pub use options::{PaperOptions, PaperSurvey};
pub use tables::{Detail, PaperTables, Segmented};

use crate::error::{Error, Result};
use crate::experiment::halves::halves_of;
use crate::experiment::inner_work::InnerWork;
use crate::experiment::known_motion::{KnownMotion, paper_motions};
use crate::pipeline::{Context, Until, first_stones, run_in};
use crate::project::{Epoch, Project};
use crate::results::ResultSet;
use crate::settings::Settings;
use crate::storage::store::{Keeps, StepStore};
use crate::truth::outcome;
use case::{Case, Method, file_name};
use detectors::DetectorTraining;
use nalgebra::{Point3, Vector3};
use outcome::{MaskOrigin, Outcome};
use std::path::Path;
use std::sync::Arc;
use stonewise_core::change::{ChangeField, ChangePoint};
use stonewise_core::epoch::EpochId;
use stonewise_core::evaluate::{MotionScore, StoneOutcome, score_change, score_stones};
use stonewise_core::progress::Progress;

/// Does the whole experiment and writes `index.html`, `tables.md`, `table2.csv`, `segmentation.csv` (where a
/// detector is measured) and `figures/` into `out`.
///
/// Each survey: the epoch is split at random into halves of its points and photos; each half is labelled on
/// its own; the points of the second are moved by the paper's translation, or by its bulge, after labelling;
/// stones are matched and measured with the project's settings and again in the paper's way; M3C2 runs on the
/// same clouds. The folder of each run holds its tables. An interrupted experiment goes on where it stopped.
///
/// # Errors
/// No survey, no such epoch, no masks to learn from, or what stops a run.
pub fn paper(
    surveys: &[PaperSurvey],
    options: &PaperOptions,
    out: &Path,
    progress: &dyn Progress,
) -> Result<PaperTables> {
    let mut all = Outcome::default();
    let store = Arc::new(StepStore::new(&out.join("work"), Keeps::Every)?);
    for survey in surveys {
        add(&mut all, survey, options, out, &store, progress)?;
    }
    if all.cases.is_empty() {
        let message = "nothing to show: no survey was given, or no stone of one half was found in the other";
        return Err(Error::Survey(message.to_owned()));
    }
    let tables = PaperTables::new(&all);
    page::write(&all, &tables, out)?;
    Ok(tables)
}

/// All runs of a survey.
fn add(
    all: &mut Outcome,
    survey: &PaperSurvey,
    options: &PaperOptions,
    out: &Path,
    store: &Arc<StepStore>,
    progress: &dyn Progress,
) -> Result<()> {
    let epoch = epoch_of(&survey.project, options.epoch.as_deref())?;
    let mut halves = halves_of(&survey.project, epoch, options.seed, store, progress)?;
    if let Some(minutes) = options.train_minutes {
        let training = DetectorTraining {
            epoch,
            valid: options.valid.as_deref(),
            params: &survey.project.settings.segment,
            minutes,
            store,
            out: &out.join("work/training"),
        };
        halves.settings.segment.model = training.run(&survey.name, &mut all.detectors, progress)?;
        halves.epochs.iter_mut().for_each(|half| half.masks = None);
    }
    let origin = MaskOrigin::of(survey, &halves, options);
    let folder = out.join(file_name(&survey.name));
    let context = Context::with_store(&halves, &folder, Arc::clone(store), progress)?;
    let motions = paper_motions(&first_stones(&context)?)?;
    if all.example.is_none() {
        all.example = figure_5::example(&context, &origin.words)?;
    }
    all.origins.push(origin);
    let split = SplitSurvey {
        survey,
        halves: &halves,
    };
    for motion in &motions {
        for method in Method::ALL {
            progress.begin(&format!("{}: {}, {}", survey.name, motion.name, method.name()), 1);
            let folder = folder.join(format!("{}-{}", motion.name, method.folder()));
            all.cases
                .extend(measure(&split, motion, method, &folder, store, progress)?);
            progress.advance(1);
        }
    }
    Ok(())
}

/// The epoch of this name, or the first.
fn epoch_of<'a>(project: &'a Project, name: Option<&str>) -> Result<&'a Epoch> {
    let epochs = &project.epochs;
    let found = match name {
        None => epochs.first(),
        Some(name) => epochs.iter().find(|e| e.name == name),
    };
    let names: Vec<&str> = epochs.iter().map(|e| e.name.as_str()).collect();
    found.ok_or_else(|| Error::Input {
        path: project.path.clone(),
        message: format!("no such epoch; there are: {}", names.join(", ")),
    })
}

/// A survey and the project of its halves.
struct SplitSurvey<'a> {
    survey: &'a PaperSurvey,
    halves: &'a Project,
}

/// Measures one case; `None` where the method finds no stone of the first half in the second.
fn measure(
    split: &SplitSurvey,
    motion: &KnownMotion,
    method: Method,
    folder: &Path,
    store: &Arc<StepStore>,
    progress: &dyn Progress,
) -> Result<Option<Case>> {
    let SplitSurvey { survey, halves } = *split;
    let mut project = halves.clone();
    project.settings = method.settings(&project.settings);
    if method == Method::Paper && survey.paper_part.is_some() {
        project.part.clone_from(&survey.paper_part);
    }
    project.epochs[EpochId::at(1)].motion = Some(motion.field.clone());
    let inner = InnerWork(progress);
    let context = Context::with_store(&project, folder, Arc::clone(store), &inner)?;
    match run_in(&context, Until::Compared) {
        Err(Error::NoMatch { .. }) => return Ok(None),
        outcome => outcome?,
    };
    let results = ResultSet::read(folder)?;
    let scores = results
        .evaluation
        .as_ref()
        .and_then(|e| Some((e.stones.clone()?, e.m3c2.clone()?)));
    let (stones, m3c2) = scores.ok_or_else(|| Error::Input {
        path: folder.join("evaluation.json"),
        message: "holds no scores; remove its folder".to_owned(),
    })?;
    let inside = motion
        .region
        .map(|region| score_region(&results, motion, region, &project.settings));
    Ok(Some(Case {
        survey: survey.name.clone(),
        motion: motion.clone(),
        method,
        results,
        stones,
        m3c2,
        inside,
    }))
}

/// Scores of the stones and of M3C2 within half a diameter of a place.
fn score_region(
    results: &ResultSet,
    motion: &KnownMotion,
    (centre, diameter_m): (Point3<f64>, f64),
    settings: &Settings,
) -> [MotionScore; 2] {
    let near = |p: &Point3<f64>| (p - centre).norm() < 0.5 * diameter_m;
    let normal = |id: u32| results.outlines.get(&id).map_or(Vector3::x(), |o| o.normal);
    let outcomes: Vec<StoneOutcome> = results
        .stones
        .iter()
        .filter(|row| near(&row.centroid))
        .map(|row| outcome(row, normal(row.stone_id), results.datum()))
        .collect();
    let truth = |p: &Point3<f64>| motion.field.displacement_at(p);
    let stones = score_stones(&outcomes, truth, &settings.evaluate);
    let points = results.distances.iter().filter(|p| near(&p.position));
    let field = ChangeField {
        points: points
            .map(|p| ChangePoint {
                position: p.position,
                normal: p.normal.unwrap_or_else(Vector3::x),
                distance_m: Some(p.distance_m),
                detection_limit_m: Some(p.detection_limit_m),
                spread_m: [None; 2],
                counts: [0; 2],
            })
            .collect(),
    };
    let face = |p: &ChangePoint| results.facade.frame_at(&p.position).out;
    [stones, score_change(&field, truth, face, &settings.evaluate)]
}
