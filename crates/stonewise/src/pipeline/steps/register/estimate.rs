//! The motions of matched stones, by the estimator of the project.

use super::pairs::DiskPairs;
use super::photos::{DiskPhotos, tracks_photos};
use super::registered::Registered;
use super::tracked;
use super::windows::align_windows;
use crate::error::{Error, Result};
use crate::pipeline::graph::Run;
use crate::pipeline::steps::label::Labelled;
use crate::results::records::{AdjustmentRecord, EstimatorRecord, GicpRecord, PhotosRecord};
use crate::settings::Estimator;
use crate::storage::step::StepDir;
use crate::warnings::Warnings;
use std::path::PathBuf;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::id::StoneId;
use stonewise_core::registration::photos::PhotoSource;
use stonewise_core::registration::{AdjustmentReport, JointMotions, adjust_with_photos};
use stonewise_core::stone::PairResult;

/// Measures the matched stones in the folder of the step; with the joint distribution of their motions, if the
/// estimator gives one.
pub(super) fn estimate(
    run: &Run,
    epochs: Pair<EpochId>,
    labelled: Pair<&Labelled>,
    matches: &[(StoneId, StoneId)],
    step: &StepDir,
    warnings: &Warnings,
) -> Result<(Registered, Option<JointMotions>)> {
    let project = run.context.project;
    match project.settings.registration.estimator {
        Estimator::Adjustment => adjust(run, epochs, labelled, matches, step, warnings),
        Estimator::Gicp => {
            let size_m = project.settings.ingest.size_m;
            let params = &project.settings.registration.gicp;
            let progress = run.context.progress;
            let results = align_windows(labelled, matches, size_m, params, progress)?;
            Ok((of_windows(results), None))
        }
    }
}

fn adjust(
    run: &Run,
    epochs: Pair<EpochId>,
    labelled: Pair<&Labelled>,
    matches: &[(StoneId, StoneId)],
    step: &StepDir,
    warnings: &Warnings,
) -> Result<(Registered, Option<JointMotions>)> {
    let context = run.context;
    let params = &context.project.settings.registration;
    let pairs = DiskPairs::gather(labelled, matches, params.border_noises, step, context.progress)?;
    let photos = match tracks_photos(context.project, epochs) {
        true => {
            let photos = Pair::new(run.posed(epochs.first)?, run.posed(epochs.later)?);
            let photos = photos.each_ref().map(|p| &**p);
            DiskPhotos::gather(context, photos, labelled, &pairs, step, warnings)?
        }
        false => None,
    };
    let photos = photos.as_ref().map(|p| p as &dyn PhotoSource<Error>);
    let mut adjustment = params.adjustment.clone();
    adjustment.free_rotation |= context.project.is_aligned(epochs.later);
    let mut report = adjust_with_photos(&pairs, photos, &adjustment, context.progress)?;
    pairs.remove()?;
    tracked::write(step, &report)?;
    let joint = report.joint.take();
    Ok((of_adjustment(report), joint))
}

fn of_adjustment(mut report: AdjustmentReport) -> Registered {
    let photos = PhotosRecord::of(&report);
    report.results.sort_by_key(|r| r.first);
    let finite = |v: f64| v.is_finite().then_some(v);
    let c = report.common_covariance;
    let adjustment = AdjustmentRecord {
        converged: report.converged,
        iterations: report.iterations,
        noise_m: report.sigma_m.map(finite),
        roughness_m: finite(report.roughness_m),
        surface_cell_m: finite(report.cell_m),
        correlation_factor: finite(report.correlation_factor),
        variance_components: report.components,
        common_motion_m: report.common_motion.into(),
        common_motion_covariance_m2: std::array::from_fn(|i| std::array::from_fn(|j| c[(i, j)])),
        loose: report.loose,
        breaks: report.breaks,
        photos,
    };
    Registered {
        results: report.results,
        neighbours: report.neighbours,
        estimator: EstimatorRecord::Adjustment(Box::new(adjustment)),
        epoch_errors: None,
        error_stones: Vec::new(),
        deformation: None,
        off_wall: Vec::new(),
        folder: PathBuf::new(),
    }
}

fn of_windows(results: Vec<PairResult>) -> Registered {
    let measured = results.iter().filter_map(|r| r.motion.as_ref().ok());
    let gicp = GicpRecord {
        stones: results.len(),
        measured: measured.clone().count(),
        loose: measured.filter(|m| m.loose).count(),
    };
    Registered {
        results,
        neighbours: Vec::new(),
        estimator: EstimatorRecord::Gicp(gicp),
        epoch_errors: None,
        error_stones: Vec::new(),
        deformation: None,
        off_wall: Vec::new(),
        folder: PathBuf::new(),
    }
}
