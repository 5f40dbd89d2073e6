//! The motion of every matched stone.

use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::label::Labelled;
use crate::pipeline::matching::Matched;
use crate::pipeline::pairs::DiskPairs;
use crate::pipeline::step::Key;
use crate::pipeline::windows::align_windows;
use crate::project::Estimator;
use crate::stable::StableArea;
use serde::{Deserialize, Serialize};
use serde_json::json;
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::registration::{DatumError, NetworkReport, adjust};
use stonewise_core::stone::{MotionFailure, PairResult};

/// Motions of a pair of epochs.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Registered {
    /// One result per matched stone, ascending by stone of the first epoch.
    pub results: Vec<PairResult>,
    /// What the estimator says about itself: noise, datum, breaks.
    pub summary: serde_json::Value,
    /// What the project's stable areas say of the epochs' registration; `None` without such areas, and where they say nothing.
    pub datum: Option<DatumError>,
    /// Why stable areas that the project names say nothing.
    pub stable_areas_fail: Option<String>,
}

/// Measures the motion of every matched stone.
pub fn register(
    context: &Context,
    first: &Labelled,
    second: &Labelled,
    matched: &Matched,
    number: usize,
) -> Result<Registered> {
    let params = &context.project.settings.registration;
    // The pairs themselves, not how they were found: other parameters of the matching that find the same pairs cost nothing.
    let matches = matched.pairs();
    let key = Key::new(
        "register",
        &(params, &matches),
        &[first.key.as_str(), second.key.as_str()],
    );
    let step = context.step(&format!("register-{number}"), key, |step, _| {
        let mut registered = match params.estimator {
            Estimator::Network => {
                let pairs = DiskPairs::gather(
                    first,
                    second,
                    &matches,
                    params.border_noises,
                    step,
                    context.progress,
                )?;
                let report = adjust(&pairs, &params.network, context.progress)?;
                pairs.remove()?;
                of_network(report)
            }
            Estimator::Gicp => {
                let size_m = context.project.settings.tiles.size_m;
                of_windows(align_windows(
                    first,
                    second,
                    &matches,
                    size_m,
                    &params.gicp,
                    context.progress,
                )?)
            }
        };
        match datum_error(context, first, second)? {
            Some(Ok(datum)) => registered.datum = Some(datum),
            Some(Err(reason)) => registered.stable_areas_fail = Some(reason.to_string()),
            None => {}
        }
        registered.summary["stable_areas"] = json!(registered.datum);
        write_json(&step.file("motions.json"), &registered)
    })?;
    let registered: Registered = read_json(&step.file("motions.json"))?;
    tell_datum(context, number, &registered);
    Ok(registered)
}

/// The registration error of two epochs, where the project names areas that did not move.
fn datum_error(
    context: &Context,
    first: &Labelled,
    second: &Labelled,
) -> Result<Option<std::result::Result<DatumError, MotionFailure>>> {
    let params = &context.project.settings.registration;
    let boxes = params.stable.iter().filter_map(StableArea::bounds);
    let Some(region) = boxes.reduce(|a, b| a.union(&b)) else {
        return Ok(None);
    };
    let mut clouds = Vec::new();
    for (epoch, margin_m) in [(first, 0.0), (second, params.gicp.max_distance_m)] {
        let mut stable = Cloud::new(region.centre(), Vec::new());
        for area in &params.stable {
            let Some(bounds) = area.bounds() else { continue };
            let near = epoch.tiled.tiles.load_region(&bounds.grown(margin_m))?;
            let inside = (0..near.len()).map(|i| near.world(i));
            let kept = inside.filter(|p| margin_m > 0.0 || area.contains(p));
            stable.append(&Cloud::from_world(region.centre(), kept));
        }
        clouds.push(stable);
    }
    Ok(Some(DatumError::of(&clouds[0], &clouds[1], &params.gicp)))
}

/// Says how the stones moved in common, and what the stable areas seem to have done.
fn tell_datum(context: &Context, number: usize, registered: &Registered) {
    let epoch = &context.project.epochs[number - 1].name;
    let text = |mean: [f64; 3], variance: [f64; 3]| {
        let parts = mean.iter().zip(variance);
        let parts: Vec<String> = parts
            .map(|(m, v)| format!("{:.2} +- {:.2}", 1e3 * m, 1e3 * v.max(0.0).sqrt()))
            .collect();
        format!("x {}, y {}, z {} mm", parts[0], parts[1], parts[2])
    };
    let read = |key: &str| serde_json::from_value::<Vec<f64>>(registered.summary[key].clone()).ok();
    if let (Some(m), Some(c)) = (read("common_motion_m"), read("common_motion_covariance_m2"))
        && m.len() == 3
        && c.len() == 9
    {
        let common = text([m[0], m[1], m[2]], [c[0], c[4], c[8]]);
        let message = format!("common motion of all stones (a check of the datum): {common}");
        context.warnings.notice("register", epoch, message);
    }
    if let Some(datum) = &registered.datum {
        let c = datum.covariance.diagonal();
        let shift = text(datum.shift.into(), [c[0], c[1], c[2]]);
        let message = format!("registration error from the stable areas: {shift}");
        context.warnings.notice("register", epoch, message);
    }
    if let Some(reason) = &registered.stable_areas_fail {
        let message = format!(
            "[[registration.stable]] does not show the epochs' registration: {reason}; it is taken as unknown. Name areas with \
             points in both epochs and faces in three directions, or state epoch_error_m"
        );
        context.warnings.skipped("register", epoch, message);
    }
}

fn of_network(mut report: NetworkReport) -> Registered {
    report.results.sort_by_key(|r| r.first);
    let summary = json!({
        "estimator": "network",
        "noise_m": report.sigma_m,
        "roughness_m": report.roughness_m,
        "surface_cell_m": report.cell_m,
        "correlation_factor": report.correlation_factor,
        "variance_components": report.components,
        "common_motion_m": report.common_motion,
        "common_motion_covariance_m2": report.common_covariance,
        "iterations": report.iterations,
        "converged": report.converged,
        "loose": report.loose,
        "breaks": report.breaks,
    });
    Registered {
        results: report.results,
        summary,
        datum: None,
        stable_areas_fail: None,
    }
}

fn of_windows(results: Vec<PairResult>) -> Registered {
    let measured = results.iter().filter_map(|r| r.motion.as_ref().ok());
    let summary = json!({
        "estimator": "gicp",
        "stones": results.len(),
        "measured": measured.clone().count(),
        "loose": measured.filter(|m| m.loose).count(),
    });
    Registered {
        results,
        summary,
        datum: None,
        stable_areas_fail: None,
    }
}
