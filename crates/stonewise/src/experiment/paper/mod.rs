//! The paper's experiment, section 4 and 5: one epoch split into halves, the second moved, every figure and
//! table again.

mod case;
mod figure_5;
mod figures;
mod page;
mod tables;

pub use tables::PaperTables;

use crate::error::{Error, Result};
use crate::experiment::halves::halves_of;
use crate::experiment::inner_work::InnerWork;
use crate::experiment::known_motion::{KnownMotion, paper_motions};
use crate::part::Part;
use crate::pipeline::{Context, Until, first_stones, run_in};
use crate::project::{Epoch, Project};
use crate::results::ResultSet;
use crate::results::names::PairFile;
use crate::storage::store::{Keeps, StepStore};
use crate::truth::outcome;
use case::{Case, Method, file_name};
use figure_5::figure_5;
use nalgebra::{Point3, Vector3};
use std::path::Path;
use std::sync::Arc;
use stonewise_core::change::{ChangeField, ChangePoint};
use stonewise_core::epoch::EpochId;
use stonewise_core::evaluate::{EvaluationParams, MotionScore, StoneOutcome, score_change, score_stones};
use stonewise_core::progress::Progress;

/// A survey of which one epoch is split, under the name of its scanner.
#[derive(Clone, Debug)]
pub struct PaperSurvey {
    /// `TLS`, `UAV`, or what the caller calls it.
    pub name: String,
    /// The survey; only one epoch of it is used.
    pub project: Project,
    /// Where the paper's estimator, which is slow, measures; everywhere where absent.
    pub paper_part: Option<Part>,
}

/// Does the whole experiment and writes `index.html`, `tables.md`, `table2.csv` and `figures/` into `out`.
///
/// Each survey: the epoch of this name (absent: the first) is split at random into halves of its points and photos;
/// each half is labelled on its own; the points of the second are moved by the paper's translation, or by its bulge,
/// after labelling; stones are matched and measured with the project's settings and again in the paper's way; M3C2 runs
/// on the same clouds. The folder of each run holds its tables. An interrupted experiment goes on where it stopped.
///
/// # Errors
/// No survey, no such epoch, or what stops a run.
pub fn paper(
    surveys: &[PaperSurvey],
    epoch: Option<&str>,
    seed: u64,
    out: &Path,
    progress: &dyn Progress,
) -> Result<PaperTables> {
    let store = Arc::new(StepStore::new(&out.join("work"), Keeps::Every)?);
    let (mut cases, mut example) = (Vec::new(), None);
    for survey in surveys {
        let chosen = epoch_of(&survey.project, epoch)?;
        let halves = halves_of(&survey.project, chosen, seed, &store, progress)?;
        let folder = out.join(file_name(&survey.name));
        let context = Context::with_store(&halves, &folder, Arc::clone(&store), progress)?;
        if example.is_none() {
            example = figure_5(&context)?;
        }
        for motion in &paper_motions(&first_stones(&context)?)? {
            for method in Method::ALL {
                progress.begin(&format!("{}: {}, {}", survey.name, motion.name, method.name()), 1);
                let folder = folder.join(format!("{}-{}", motion.name, method.folder()));
                cases.extend(measure(
                    survey, &halves, motion, method, &folder, &store, progress,
                )?);
                progress.advance(1);
            }
        }
    }
    if cases.is_empty() {
        let message = "nothing to show: no survey was given, or no stone of one half was found in the other";
        return Err(Error::Survey(message.to_owned()));
    }
    let tables = PaperTables::new(&cases)?;
    page::write(&cases, example, &tables, out)?;
    Ok(tables)
}

/// The epoch of this name, or the first.
fn epoch_of<'a>(project: &'a Project, name: Option<&str>) -> Result<&'a Epoch> {
    let mut epochs = project.epochs.iter();
    let found = epochs.find(|e| name.is_none_or(|name| e.name == name));
    found.ok_or_else(|| {
        let names: Vec<&str> = project.epochs.iter().map(|e| e.name.as_str()).collect();
        Error::Input {
            path: project.path.clone(),
            message: format!("no such epoch; there are: {}", names.join(", ")),
        }
    })
}

/// Measures one case; `None` where the method finds no stone of the first half in the second.
fn measure(
    survey: &PaperSurvey,
    halves: &Project,
    motion: &KnownMotion,
    method: Method,
    folder: &Path,
    store: &Arc<StepStore>,
    progress: &dyn Progress,
) -> Result<Option<Case>> {
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
    let scores = { results.evaluation.as_ref() }.and_then(|e| Some([e.stones.clone()?, e.m3c2.clone()?]));
    let all = scores.ok_or_else(|| Error::Input {
        path: folder.join(PairFile::Evaluation.place(1)),
        message: "holds no scores; remove its folder".to_owned(),
    })?;
    let params = &project.settings.evaluate;
    Ok(Some(Case {
        inside: motion
            .region
            .map(|region| inside(&results, motion, region, params)),
        survey: survey.name.clone(),
        motion: motion.clone(),
        method,
        settings: project.settings,
        results,
        all,
    }))
}

/// Scores of the stones and of M3C2 within half a diameter of a place.
fn inside(
    results: &ResultSet,
    motion: &KnownMotion,
    (centre, diameter_m): (Point3<f64>, f64),
    params: &EvaluationParams,
) -> [MotionScore; 2] {
    let near = |p: &Point3<f64>| (p - centre).norm() < 0.5 * diameter_m;
    let truth = |p: &Point3<f64>| motion.field.displacement_at(p);
    let stones: Vec<StoneOutcome> = { results.stones.iter() }
        .filter(|row| near(&row.centroid))
        .map(|row| outcome(row, results.normal(row), results.datum()))
        .collect();
    let core = ChangeField {
        points: { results.distances.iter() }
            .filter(|p| near(&p.position))
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
    [
        score_stones(&stones, truth, params),
        score_change(&core, truth, face, params),
    ]
}
