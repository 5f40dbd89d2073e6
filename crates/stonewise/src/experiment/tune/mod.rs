//! The exhaustive grid by which the paper chose its parameters.

mod grid;
mod outcome;
mod page;

pub use grid::{Dimension, default_grid};
pub use outcome::{Tuned, TunedPoint};

use crate::error::{Error, Result};
use crate::experiment::halves::halves_of;
use crate::experiment::inner_work::InnerWork;
use crate::experiment::known_motion::paper_motions;
use crate::experiment::settings_with::{count_changes, project_lines, settings_with};
use crate::files::write_text;
use crate::part::Part;
use crate::pipeline::{Context, Until, first_stones, run_in};
use crate::project::Project;
use crate::storage::store::{Keeps, StepStore};
use std::path::Path;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::parallel::in_parallel;
use stonewise_core::progress::Progress;

/// A share of the most stones that the recommended combination must measure at least: 0.95, because the paper chooses by
/// the lowest RMSE and by the most matches at once, and a gain in accuracy is not worth more than a twentieth of the stones.
const ENOUGH: f64 = 0.95;

/// What is tuned, on what.
#[derive(Clone, Debug, Default)]
pub struct TuneOptions {
    /// Parameters and their values; [`default_grid`] where empty.
    pub grid: Vec<Dimension>,
    /// Points that take part; all where absent.
    pub part: Option<Part>,
    /// Which points and photos go to which half, where the project prescribes no motion.
    pub seed: u64,
}

/// Tries every combination of parameters and writes `tune.csv`, `index.html`, `tune.svg` and
/// `recommended.toml` into `out`.
///
/// Truth is the project's known motion. A project without one is split: epoch 1 into halves
/// ([`crate::split()`]), the points of the second moved once by the paper's translation and once by its
/// bulge; errors are pooled over both, because the translation alone would favour any amount of smoothing.
/// Combinations run in parallel; steps are kept in `out/work`, one version for each set of parameters,
/// so that combinations share what they have in common and an interrupted grid goes on.
///
/// # Errors
/// A parameter or value that cannot be, no stones, files. A combination that cannot be measured is a row that
/// says why.
pub fn tune(project: &Project, options: &TuneOptions, out: &Path, progress: &dyn Progress) -> Result<Tuned> {
    let grid = match options.grid.as_slice() {
        [] => default_grid(&project.settings),
        given => given.to_vec(),
    };
    let values = grid::points(&grid);
    let changes = { values.iter() }
        .map(|point| {
            settings_with(&project.settings, &changes(&grid, point))?;
            count_changes(&project.settings, &changes(&grid, point))
        })
        .collect::<Result<Vec<usize>>>()?;
    let store = Arc::new(StepStore::new(&out.join("work"), Keeps::Every)?);
    let whole = Project {
        part: options.part.clone(),
        ..project.clone()
    };
    let cases = cases(&whole, options.seed, &store, out, progress)?;

    progress.begin("tune", values.len() as u64);
    let points = in_parallel(values.len(), |i| {
        progress.check()?;
        let point = measure(&cases, &grid, &values[i], &store, &out.join("points"), progress)?;
        progress.advance(1);
        Ok::<_, Error>(point)
    })?;
    let recommended = recommended(&points, &changes);
    let tuned = Tuned {
        recommended,
        lines: recommended.map_or_else(String::new, |i| {
            project_lines(&self::changes(&grid, &points[i].values))
        }),
        points,
    };
    page::write(&tuned, &grid, &project.name, &cases, out)?;
    write_text(&out.join("recommended.toml"), &tuned.lines)?;
    Ok(tuned)
}

fn changes<'a>(grid: &'a [Dimension], values: &'a [toml::Value]) -> Vec<(&'a str, &'a toml::Value)> {
    grid.iter().map(|d| d.key.as_str()).zip(values).collect()
}

/// Projects with a known motion in which every combination is tried, with their names.
fn cases(
    project: &Project,
    seed: u64,
    store: &Arc<StepStore>,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Vec<(String, Project)>> {
    if project.epochs.iter().take(2).any(|e| e.motion.is_some()) {
        let mut project = project.clone();
        project.epochs.truncate(2);
        return Ok(vec![("the motion in the project file".to_owned(), project)]);
    }
    let halves = halves_of(project, project.epochs.reference(), seed, store, progress)?;
    let context = Context::with_store(&halves, &out.join("points"), Arc::clone(store), progress)?;
    let motions = paper_motions(&first_stones(&context)?)?;
    let moved = motions.into_iter().map(|motion| {
        let mut moved = halves.clone();
        moved.epochs[EpochId::at(1)].motion = Some(motion.field);
        (format!("halves of epoch 1, {}", motion.name), moved)
    });
    Ok(moved.collect())
}

fn measure(
    cases: &[(String, Project)],
    grid: &[Dimension],
    values: &[toml::Value],
    store: &Arc<StepStore>,
    out: &Path,
    progress: &dyn Progress,
) -> Result<TunedPoint> {
    let mut point = TunedPoint {
        values: values.to_vec(),
        ..TunedPoint::default()
    };
    let name: Vec<String> = values.iter().map(|v| v.to_string().replace('"', "")).collect();
    for (number, (_, case)) in (1..).zip(cases) {
        let project = Project {
            settings: settings_with(&case.settings, &changes(grid, values))?,
            ..case.clone()
        };
        let folder = out.join(name.join("_")).join(number.to_string());
        let inner = InnerWork(progress);
        let context = Context::with_store(&project, &folder, Arc::clone(store), &inner)?;
        let pair = match run_in(&context, Until::Registered) {
            Ok(summary) => summary.pairs.into_iter().next().unwrap_or_default(),
            Err(error @ (Error::NoMatch { .. } | Error::Survey(_) | Error::Registration(_))) => {
                point.failure = Some(error.to_string());
                continue;
            }
            Err(error) => return Err(error),
        };
        let share = 1.0 / cases.len() as f64;
        point.stones += share * pair.rows.len() as f64;
        point.matched += share * pair.rows.iter().filter(|r| r.matched_id.is_some()).count() as f64;
        point.measured += share * pair.rows.iter().filter(|r| r.motion.is_some()).count() as f64;
        point.scores.extend(pair.evaluation.and_then(|e| e.stones));
    }
    Ok(point)
}

/// The combination with the lowest RMSE among those that measure nearly the most stones; `changes`: how many parameters
/// each of them changes.
fn recommended(points: &[TunedPoint], changes: &[usize]) -> Option<usize> {
    let measured = || (0..points.len()).filter_map(|i| Some((i, points[i].rmse_m()?)));
    let most = measured().map(|(i, _)| points[i].measured).fold(0.0, f64::max);
    let enough = measured().filter(|(i, _)| points[*i].measured >= ENOUGH * most);
    let best = enough.min_by(|(i, a), (j, b)| {
        let more_stones = points[*j].measured.total_cmp(&points[*i].measured);
        a.total_cmp(b)
            .then(more_stones)
            .then(changes[*i].cmp(&changes[*j]))
    });
    Some(best?.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::evaluate::{ErrorStatistics, EvaluationParams, score_motions};

    fn point(measured: f64, rmse_m: Option<f64>) -> TunedPoint {
        // Two errors whose root mean square is that.
        let errors = rmse_m.and_then(|e| ErrorStatistics::of(&[e, -e], &[0.0; 2], 1.0));
        let mut score = score_motions(&[], 0, &EvaluationParams::default());
        score.errors.norm_3d = errors;
        TunedPoint {
            measured,
            scores: vec![score],
            ..TunedPoint::default()
        }
    }

    #[test]
    fn the_recommended_one_measures_nearly_all_stones_and_changes_least() {
        let stones = [
            (100.0, 5.0),
            (98.0, 2.0),
            (98.0, 2.0),
            (98.0, 3.0),
            (60.0, 1.0),
            (50.0, 1.0),
        ];
        let mut points: Vec<TunedPoint> = stones.map(|(n, rmse)| point(n, Some(rmse))).into();
        points.push(point(0.0, None));
        assert_eq!(recommended(&points, &[0, 2, 1, 0, 0, 0, 0]), Some(2));
        assert_eq!(recommended(&points[6..], &[0]), None);
    }
}
