//! The exhaustive grid by which the paper chose its parameters.

mod front;
mod grid;
mod page;
mod tuned;

pub use grid::{Dimension, DimensionError, default_grid};
pub use tuned::{PointErrors, TuneOptions, Tuned, TunedPoint};

use crate::error::{Error, Result};
use crate::experiment::halves::halves_of;
use crate::experiment::inner_work::InnerWork;
use crate::experiment::known_motion::paper_motions;
use crate::experiment::settings_with::{count_changes, project_lines, settings_with};
use crate::files::write_text;
use crate::pipeline::{Context, Until, first_stones, run_in};
use crate::project::Project;
use crate::storage::store::{Keeps, StepStore};
use front::{Worth, front, recommended};
use std::path::Path;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::evaluate::MotionScore;
use stonewise_core::parallel::in_parallel;
use stonewise_core::progress::Progress;

/// Tries every combination of parameters and writes `tune.csv`, `index.html`, `tune.svg` and
/// `recommended.toml` into `out`.
///
/// Truth is the project's known motion. A project without one is split: epoch 1 into halves
/// ([`crate::split()`]), the points of the second moved once by the paper's translation and once by its
/// bulge; errors are pooled over both, because the translation alone would favour any amount of smoothing.
/// Points of the grid run in parallel; steps are kept in `out/work`, one version for each set of parameters,
/// so that points share what they have in common and an interrupted grid goes on.
///
/// # Errors
/// A parameter or value that cannot be, no stones, files. A grid point that cannot be measured is a row that
/// says why.
pub fn tune(project: &Project, options: &TuneOptions, out: &Path, progress: &dyn Progress) -> Result<Tuned> {
    let grid = match options.grid.as_slice() {
        [] => default_grid(&project.settings),
        given => given.to_vec(),
    };
    let values = grid::points(&grid);
    for point in &values {
        settings_with(&project.settings, &changes(&grid, point))?;
    }
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
    let ranked: Vec<Worth> = points
        .iter()
        .map(|p| {
            let worth = Worth {
                stones: p.measured,
                rmse_m: p.errors.map(|e| e.rmse_m),
                changes: count_changes(&project.settings, &changes(&grid, &p.values))?,
            };
            Ok(worth)
        })
        .collect::<Result<_>>()?;

    let best = recommended(&ranked);
    let tuned = Tuned {
        front: front(&ranked),
        recommended: best,
        lines: best.map_or_else(String::new, |i| project_lines(&changes(&grid, &points[i].values))),
        grid,
        points,
    };
    page::write(&tuned, &whole, &cases, out)?;
    write_text(&out.join("recommended.toml"), &tuned.lines)?;
    Ok(tuned)
}

fn changes<'a>(grid: &'a [Dimension], values: &'a [toml::Value]) -> Vec<(&'a str, &'a toml::Value)> {
    grid.iter().map(|d| d.key.as_str()).zip(values).collect()
}

/// Projects with a known motion in which every grid point is tried, with their names.
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
        stones: 0.0,
        matched: 0.0,
        measured: 0.0,
        errors: None,
        failure: None,
    };
    let name: Vec<String> = values.iter().map(|v| v.to_string().replace('"', "")).collect();
    let mut scores = Vec::new();

    for (number, (_, case)) in (1..).zip(cases) {
        let settings = settings_with(&case.settings, &changes(grid, values))?;
        let project = Project {
            settings,
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
        scores.extend(pair.evaluation.and_then(|e| e.stones));
    }

    if point.failure.is_none() {
        point.errors = PointErrors::of(&scores);
    }
    Ok(point)
}

impl PointErrors {
    /// Errors of several motions together, each weighted by its number of stones.
    fn of(scores: &[MotionScore]) -> Option<Self> {
        type Pick = fn(&MotionScore) -> Option<&stonewise_core::evaluate::ErrorStatistics>;
        let pooled = |pick: Pick| {
            let (squares, count) = scores.iter().filter_map(pick).fold((0.0, 0.0), |(s, n), e| {
                (s + e.rmse_m.powi(2) * e.count as f64, n + e.count as f64)
            });
            (count > 0.0).then(|| (squares / count).sqrt())
        };
        let norms: Vec<_> = scores.iter().filter_map(|s| s.errors.norm_3d.as_ref()).collect();
        let count: usize = norms.iter().map(|n| n.count).sum();
        let wrong: f64 = norms.iter().map(|n| n.outlier_rate * n.count as f64).sum();
        Some(Self {
            rmse_m: pooled(|s| s.errors.norm_3d.as_ref())?,
            in_plane_m: pooled(|s| s.errors.in_plane_per_axis.as_ref())?,
            out_of_plane_m: pooled(|s| s.errors.out_of_plane.as_ref())?,
            p95_m: norms.iter().map(|n| n.p95_m).fold(0.0, f64::max),
            outlier_rate: wrong / count as f64,
        })
    }
}
