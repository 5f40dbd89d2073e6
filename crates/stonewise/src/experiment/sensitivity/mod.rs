//! How the results depend on masks, noise, spacing, motion, poses and overlap: what the paper left for future
//! work.

mod cases;
mod inputs;
mod page;
mod point;

pub use cases::Influence;
pub(super) use cases::base;
pub use point::{SensitivityOptions, SensitivityPoint};

use crate::error::{Error, Result};
use crate::experiment::inner_work::InnerWork;
use crate::pipeline::{Context, Until, run_in};
use crate::project::Project;
use crate::settings::Estimator;
use crate::storage::store::{Keeps, StepStore};
use crate::truth::evaluate_truth;
use cases::{Variant, variants};
use inputs::inputs;
use std::path::Path;
use std::sync::Arc;
use stonewise_core::evaluate::{ErrorStatistics, TruthScore};
use stonewise_core::matching::MatchParams;
use stonewise_core::parallel::in_parallel;
use stonewise_core::progress::Progress;

/// Measures all curves on simulated walls and writes `sensitivity.csv`, `index.html` and one SVG a plot into
/// `out`.
///
/// The base is a wall that moves by the paper's translation between two surveys, without any error of
/// registration; one thing is changed at a time. Truth is the simulator's. An interrupted experiment goes on
/// where it stopped.
///
/// # Errors
/// What stops a simulation or a run. A variant in which nothing can be measured is a point with no stones.
pub fn sensitivity(
    options: &SensitivityOptions,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Vec<SensitivityPoint>> {
    let store = Arc::new(StepStore::new(&out.join("work"), Keeps::Every)?);
    let influences = match options.influences.as_slice() {
        [] => Influence::ALL.to_vec(),
        given => given.to_vec(),
    };
    let all: Vec<(Variant, u64)> = influences
        .into_iter()
        .flat_map(variants)
        .flat_map(|variant| (1..=options.seeds.max(1)).map(move |seed| (variant, seed)))
        .collect();
    progress.begin("sensitivity", all.len() as u64);
    let measured = in_parallel(all.len(), |i| {
        progress.check()?;
        let (variant, seed) = &all[i];
        let folder = out.join("runs").join(i.to_string());
        let points = measure(variant, options, *seed, &folder, &store, progress)?;
        progress.advance(1);
        Ok::<_, Error>(points)
    })?;
    let seeds = options.seeds.max(1) as usize;
    let points: Vec<SensitivityPoint> = measured.chunks(seeds).flat_map(pooled).collect();
    page::write(&points, options, out)?;
    Ok(points)
}

/// What one variant of one wall came to, for each scanner and method.
fn measure(
    variant: &Variant,
    options: &SensitivityOptions,
    seed: u64,
    out: &Path,
    store: &Arc<StepStore>,
    progress: &dyn Progress,
) -> Result<Vec<SensitivityPoint>> {
    let inner = InnerWork(progress);
    let inputs = inputs(variant, &base(options.size_m, seed), store, &inner)?;
    let methods: &[&str] = if options.with_paper {
        &["stonewise", "paper"]
    } else {
        &["stonewise"]
    };
    let mut points = Vec::new();
    for (scanner, project) in &inputs.projects {
        for method in methods {
            let mut project: Project = project.clone();
            if *method == "paper" {
                project.settings.r#match = MatchParams::paper();
                project.settings.registration.estimator = Estimator::Gicp;
            }
            let folder = out.join(format!("{}-{method}", scanner.to_lowercase()));
            let context = Context::with_store(&project, &folder, Arc::clone(store), &inner)?;
            let score = match run_in(&context, Until::Registered) {
                Ok(_) => {
                    let params = &project.settings.evaluate;
                    evaluate_truth(&folder, &inputs.truth, params)?.external
                }
                Err(Error::NoMatch { .. } | Error::Survey(_) | Error::Registration(_)) => None,
                Err(error) => return Err(error),
            };
            points.push(point(variant, scanner, method, inputs.x, score.as_ref()));
        }
    }
    Ok(points)
}

fn point(
    variant: &Variant,
    scanner: &str,
    method: &str,
    x: f64,
    score: Option<&TruthScore>,
) -> SensitivityPoint {
    let errors = score.map(|s| &s.motions.errors);
    let figure =
        |of: Option<&ErrorStatistics>, which: fn(&ErrorStatistics) -> f64| of.map_or(f64::NAN, which);
    let norm = errors.and_then(|e| e.norm_3d.as_ref());
    SensitivityPoint {
        influence: variant.influence,
        kind: variant.kind.to_owned(),
        scanner: scanner.to_owned(),
        method: method.to_owned(),
        x,
        stones: score.map_or([0, 0], |s| [s.countable, s.found]),
        rmse_m: [
            norm,
            errors.and_then(|e| e.in_plane_per_axis.as_ref()),
            errors.and_then(|e| e.out_of_plane.as_ref()),
        ]
        .map(|s| figure(s, |s| s.rmse_m)),
        median_m: figure(norm, |s| s.median_m),
        outlier_rate: figure(norm, |s| s.outlier_rate),
    }
}

/// Points of each variant, pooled over several walls: counts are added, squares and shares weighted by the stones that
/// were measured.
fn pooled(walls: &[Vec<SensitivityPoint>]) -> Vec<SensitivityPoint> {
    let Some(first) = walls.first() else {
        return Vec::new();
    };
    (0..first.len())
        .map(|i| {
            let same: Vec<&SensitivityPoint> = walls.iter().filter_map(|w| w.get(i)).collect();
            let measured: Vec<&&SensitivityPoint> = same.iter().filter(|p| p.stones[1] > 0).collect();
            let total: f64 = measured.iter().map(|p| p.stones[1] as f64).sum();
            let weighted = |of: &dyn Fn(&SensitivityPoint) -> f64| {
                measured.iter().map(|p| of(p) * p.stones[1] as f64).sum::<f64>() / total
            };
            SensitivityPoint {
                x: same.iter().map(|p| p.x).sum::<f64>() / same.len() as f64,
                stones: [0, 1].map(|k| same.iter().map(|p| p.stones[k]).sum()),
                rmse_m: [0, 1, 2].map(|k| weighted(&|p| p.rmse_m[k].powi(2)).sqrt()),
                median_m: weighted(&|p| p.median_m),
                outlier_rate: weighted(&|p| p.outlier_rate),
                ..first[i].clone()
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_are_pooled_by_their_stones() {
        let wall = |measured: usize, rmse: f64| {
            vec![SensitivityPoint {
                influence: Influence::Noise,
                kind: String::new(),
                scanner: "TLS".into(),
                method: "stonewise".into(),
                x: 2.0,
                stones: [10, measured],
                rmse_m: [rmse; 3],
                median_m: rmse,
                outlier_rate: 0.0,
            }]
        };
        let all = pooled(&[wall(8, 3.0), wall(2, 1.0), wall(0, f64::NAN)]);
        assert_eq!(all[0].stones, [30, 10]);
        // (8 * 9 + 2 * 1) / 10 = 7.4
        assert!((all[0].rmse_m[0] - 7.4f64.sqrt()).abs() < 1e-12);
        assert!((all[0].median_m - 2.6).abs() < 1e-12);
        assert!((all[0].found_share() - 1.0 / 3.0).abs() < 1e-12);
        assert!(pooled(&[]).is_empty());
    }
}
