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
use serde::{Deserialize, Serialize};
use serde_json::json;
use stonewise_core::registration::{NetworkReport, adjust};
use stonewise_core::stone::PairResult;

/// Motions of a pair of epochs.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Registered {
    /// One result per matched stone, ascending by stone of the first epoch.
    pub results: Vec<PairResult>,
    /// What the estimator says about itself: noise, datum, breaks.
    pub summary: serde_json::Value,
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
        let registered = match params.estimator {
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
        write_json(&step.file("motions.json"), &registered)
    })?;
    read_json(&step.file("motions.json"))
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
    Registered { results, summary }
}
