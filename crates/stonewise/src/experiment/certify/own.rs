//! Motions put into the user's own scans.

use super::certificate::Figure;
use crate::error::{Error, Result};
use crate::experiment::halves::halves_of;
use crate::experiment::inner_work::InnerWork;
use crate::experiment::known_motion::paper_motions;
use crate::pipeline::{Context, Summary, Until, first_stones, run_in};
use crate::project::Project;
use crate::storage::store::StepStore;
use std::path::Path;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::evaluate::MotionField;
use stonewise_core::progress::Progress;
use stonewise_core::statistics::median;

const PART: &str = "own";
/// Motions in units of the median lod95.
const TIMES: f64 = 3.0;
/// Most stones of unmoved halves that may be called moved by the verdict, which allows 5 % of alarms in all.
const MOST_ALARMS: f64 = 0.0;
/// Least share found of stones that moved by more than their own limit: by three times as much, and, in a bulge, by
/// anything from once to three times.
const LEAST_FOUND: [f64; 2] = [0.95, 0.7];
/// Fewest such stones of which a share says something.
const LEAST_STONES: usize = 5;

pub(super) fn figures(
    project: &Project,
    seed: u64,
    out: &Path,
    store: &Arc<StepStore>,
    progress: &dyn Progress,
) -> Result<Vec<Figure>> {
    let inner = InnerWork(progress);
    progress.begin("the survey's own scans", 3);
    let halves = halves_of(project, project.epochs.reference(), seed, store, &inner)?;

    let run = |name: &str, motion: Option<MotionField>| -> Result<Summary> {
        let mut halves = halves.clone();
        halves.epochs[EpochId::at(1)].motion = motion;
        let context = Context::with_store(&halves, &out.join("own").join(name), Arc::clone(store), &inner)?;
        let summary = run_in(&context, Until::Registered)?;
        progress.advance(1);
        Ok(summary)
    };

    let still = run("still", None)?;
    let rows = still.pairs.first().map(|p| p.rows.as_slice()).unwrap_or_default();
    let motions = || rows.iter().filter_map(|r| r.motion.as_ref());
    let mut limits: Vec<f64> = motions().map(|m| m.detection_limit_m).collect();
    let limit = median(&mut limits).ok_or_else(|| Error::Survey("no stone was measured".to_owned()))?;
    let mut figures = vec![
        Figure::shown(PART, "median lod95, mm", Some(1e3 * limit)).with(format!(
            "{} of {} stones measured",
            motions().count(),
            rows.len()
        )),
        Figure::at_most(
            PART,
            "stones of unmoved halves that are called moved",
            still.moved() as f64,
            MOST_ALARMS,
        ),
    ];

    let stones = first_stones(&Context::with_store(
        &halves,
        &out.join("own/still"),
        Arc::clone(store),
        &inner,
    )?)?;

    for (motion, least) in paper_motions(&stones)?.into_iter().zip(LEAST_FOUND) {
        let length = TIMES * limit;
        let bad = |e: stonewise_core::evaluate::MotionFieldError| Error::Survey(e.to_string());
        let field = match motion.region {
            Some((centre, diameter)) => {
                let direction = motion.field.displacement_at(&centre);
                MotionField::bulge(centre, length, diameter, direction).map_err(bad)?
            }
            None => {
                let shift = motion.field.common_displacement().unwrap_or_default();
                MotionField::translation(shift.normalize() * length).map_err(bad)?
            }
        };
        let summary = run(motion.name, Some(field))?;
        let score = summary
            .pairs
            .into_iter()
            .next()
            .and_then(|p| p.evaluation)
            .and_then(|e| e.stones)
            .ok_or_else(|| Error::Survey("the halves have no scores".to_owned()))?;
        let found = &score.significance;
        let name = format!(
            "{} of {:.2} mm: stones found of those beyond their limit",
            motion.name,
            1e3 * length
        );
        let note = format!("{} of {}", found.detectable_hits, found.detectable);
        figures.push(match found.detectable_hit_rate {
            Some(share) if found.detectable >= LEAST_STONES => {
                Figure::at_least(PART, name, share, least).with(note)
            }
            share => Figure::shown(PART, name, share).with(format!("{note}: too few to demand a share")),
        });
        let rmse = score.errors.norm_3d.as_ref().map(|e| 1e3 * e.rmse_m);
        figures.push(Figure::shown(
            PART,
            format!("{}: RMSE of the motions, 3D, mm", motion.name),
            rmse,
        ));
    }

    Ok(figures)
}
