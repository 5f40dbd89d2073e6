//! The motion of every matched stone.

mod datum;
mod mean_motion;
mod off_wall;
mod pairs;
mod photos;
mod registered;
mod sights;
mod tracked;
mod windows;

use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::r#match::Matched;
use crate::pipeline::steps::segment::Segmented;
use crate::results::records::{AdjustmentRecord, Datum, EstimatorRecord, GicpRecord, PhotosRecord};
use crate::settings::Estimator;
use crate::storage::step::Key;
use crate::texts::notices::{
    AUTO_STABLE, COMPONENT_AT_BOUND, COULD_BE_STABLE, OFF_WALL_MOVED, OFF_WALL_TOO_FEW, STABLE_MOVED,
    STABLE_TOO_FEW,
};
use datum::datum;
use mean_motion::mean_motion;
use nalgebra::Point3;
use off_wall::OffWall;
use pairs::DiskPairs;
use photos::DiskPhotos;
pub use registered::Registered;
use registered::STEP;
use sights::Sights;
use std::path::PathBuf;
use stonewise_core::registration::observers::{self, EpochErrorParams, EpochPair, epoch_errors};
use stonewise_core::registration::photos::PhotoSource;
use stonewise_core::registration::{AdjustmentReport, adjust_with_photos};
use stonewise_core::stone::PairResult;
use windows::align_windows;

/// Measures the motion of every matched stone. Also returns what is known about the registration of the
/// epochs.
pub fn register(
    context: &Context,
    photos: [&Segmented; 2],
    [first, second]: [&Labelled; 2],
    matched: &Matched,
    number: usize,
) -> Result<(Registered, Datum)> {
    let params = &context.project.settings.registration;
    // The pairs themselves, not how they were found: other parameters of the matching that find the same
    // pairs cost nothing.
    let matches = matched.pairs();
    let mut inputs = vec![first.key.as_str().to_owned(), second.key.as_str().to_owned()];
    if params.photos.enabled {
        for photo in photos.iter().flat_map(|epoch| &epoch.photos) {
            inputs.push(context.digest(&photo.path)?);
        }
    }
    let key = Key::new(
        STEP,
        &(
            params,
            &matches,
            context.project.epochs[number - 1].same_survey_as,
        ),
        &inputs.iter().map(String::as_str).collect::<Vec<_>>(),
    );
    let step = context.step(&format!("{STEP}-{number}"), key, |step, warnings| {
        let mut registered = match params.estimator {
            Estimator::Adjustment => {
                let pairs = DiskPairs::gather(
                    first,
                    second,
                    &matches,
                    params.border_noises,
                    step,
                    context.progress,
                )?;
                let photos = match params.photos.enabled {
                    true => DiskPhotos::gather(context, photos, [first, second], &pairs, step, warnings)?,
                    false => None,
                };
                let photos = photos.as_ref().map(|p| p as &dyn PhotoSource<Error>);
                let report = adjust_with_photos(&pairs, photos, &params.adjustment, context.progress)?;
                pairs.remove()?;
                tracked::write(step, &report)?;
                of_adjustment(report)
            }
            Estimator::Gicp => {
                let size_m = context.project.settings.ingest.size_m;
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
        let is_one_survey = context.project.epochs[number - 1].same_survey_as == Some(0);
        let is_known = params.epoch_error_m.is_some() || !params.stable.is_empty() || is_one_survey;
        let off_wall = match params.auto_stable || !is_known {
            true => OffWall::find([first, second], context.progress)?,
            false => OffWall::default(),
        };
        registered.off_wall = off_wall.areas().to_vec();
        let sights = Sights::gather(
            context.project,
            [first, second],
            number,
            &matches,
            &off_wall,
            context.progress,
        )?;
        let neighbours = registered.neighbours_among(&sights.stones);
        let pair = EpochPair {
            sources: &sights.sources,
            stones: &sights.seen,
            neighbours: &neighbours,
            stable: &sights.stable,
            offered: &sights.offered,
            sigma_m: registered.noise_m(),
        };
        let observers = EpochErrorParams {
            shared_error_m: params.epoch_error_m.or(params.observers.shared_error_m),
            ..params.observers.clone()
        };
        let errors = epoch_errors(&pair, &observers);
        registered.add_registration(&errors.between);
        registered.epoch_errors = Some(errors);
        registered.error_stones = sights.stones;
        write_json(&step.file("motions.json"), &registered)
    })?;
    let registered = Registered {
        folder: step.path().to_path_buf(),
        ..read_json(&step.file("motions.json"))?
    };
    let datum = datum(context.project, number, &registered, &first.stones);
    report_mean_motion(context, number, &registered, &datum);
    report_components(context, number, &registered);
    report_datum(context, number, &registered);
    report_off_wall(context, number, &registered);
    Ok((registered, datum))
}

/// Names surfaces off the wall that could show, or that showed, the registration of the epochs.
fn report_off_wall(context: &Context, number: usize, registered: &Registered) {
    let epoch = &context.project.epochs[number - 1].name;
    let largest = registered.off_wall.iter().max_by(|a, b| {
        let volume = |[low, high]: &[Point3<f64>; 2]| (high - low).product();
        volume(a).total_cmp(&volume(b))
    });
    let Some([low, high]) = largest else { return };
    let count = registered.off_wall.len().to_string();
    let corners = format!(
        "[[{:.1}, {:.1}, {:.1}], [{:.1}, {:.1}, {:.1}]]",
        low.x, low.y, low.z, high.x, high.y, high.z
    );
    let message = match context.project.settings.registration.auto_stable {
        true => &AUTO_STABLE,
        false => &COULD_BE_STABLE,
    };
    let message = message.say(&[("count", &*count), ("corners", &*corners)]);
    context.warnings.notice(STEP, epoch, message);
}

/// Notes the variance components that lie at the upper end of their range.
fn report_components(context: &Context, number: usize, registered: &Registered) {
    let EstimatorRecord::Adjustment(adjustment) = &registered.estimator else {
        return;
    };
    let epoch = &context.project.epochs[number - 1].name;
    for name in adjustment.variance_components.at_upper_bound() {
        let message = COMPONENT_AT_BOUND.say(&[("name", name)]);
        context.warnings.notice(STEP, epoch, message);
    }
}

/// Says how the stones moved on the mean.
fn report_mean_motion(context: &Context, number: usize, registered: &Registered, datum: &Datum) {
    let EstimatorRecord::Adjustment(adjustment) = &registered.estimator else {
        return;
    };
    let epoch = &context.project.epochs[number - 1].name;
    context
        .warnings
        .notice(STEP, epoch, mean_motion(adjustment, datum));
}

/// Says what the stable areas show of the registration of the epochs, and what they do not.
fn report_datum(context: &Context, number: usize, registered: &Registered) {
    let epoch = &context.project.epochs[number - 1].name;
    let named = context.project.settings.registration.stable.len();
    let cells = registered.epoch_errors.as_ref().map_or(0, |e| e.observations[2]);
    let is_stable = registered
        .epoch_errors
        .as_ref()
        .is_some_and(|e| e.datum == observers::Datum::Stable);
    let moved = registered.epoch_errors.iter().flat_map(|e| &e.moved_areas);
    for &area in moved {
        match area.checked_sub(named).and_then(|k| registered.off_wall.get(k)) {
            None => {
                let message = STABLE_MOVED.say(&[("n", &*(area + 1).to_string())]);
                context.warnings.skipped(STEP, epoch, message);
            }
            Some([low, high]) => {
                let [x, y, z]: [f64; 3] = nalgebra::center(low, high).into();
                let message = OFF_WALL_MOVED.say(&[("place", &*format!("{x:.1}, {y:.1}, {z:.1}"))]);
                context.warnings.notice(STEP, epoch, message);
            }
        }
    }
    let cells = cells.to_string();
    let values = [("cells", &*cells)];
    if named > 0 && !is_stable {
        context.warnings.skipped(STEP, epoch, STABLE_TOO_FEW.say(&values));
    }
    if named == 0 && context.project.settings.registration.auto_stable && !is_stable {
        context
            .warnings
            .notice(STEP, epoch, OFF_WALL_TOO_FEW.say(&values));
    }
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
        off_wall: Vec::new(),
        folder: PathBuf::new(),
    }
}
