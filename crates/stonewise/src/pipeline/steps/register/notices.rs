//! What a reader is told about the registration of a later epoch.

use super::mean_motion::mean_motion;
use super::registered::{Registered, STEP};
use crate::pipeline::context::Context;
use crate::results::records::{Datum, DatumState, EstimatorRecord};
use crate::texts::Said;
use crate::texts::notices::{
    AREA_OFF_WALL, AUTO_STABLE, COMPONENT_AT_BOUND, COULD_BE_STABLE, NUMBERED_AREA, OFF_WALL_TOO_FEW,
    STABLE_ALONE, STABLE_MOVED, STABLE_TOO_FEW,
};
use nalgebra::Point3;
use stonewise_core::epoch::EpochId;
use stonewise_core::registration::observers;

/// Notes what is known of the registration, and what is not; `datum`: against what motions are tested.
pub fn note_registration(context: &Context, later: EpochId, registered: &Registered, datum: &Datum) {
    report_mean_motion(context, later, registered, datum);
    report_components(context, later, registered);
    report_datum(context, later, registered);
    report_off_wall(context, later, registered);
    if datum.state == DatumState::Unknown {
        let epoch = &context.project.epochs[later].name;
        context.warnings.notice(STEP, epoch, datum.said());
    }
}

/// Names surfaces off the wall that could show, or that showed, the registration of the epochs.
fn report_off_wall(context: &Context, later: EpochId, registered: &Registered) {
    let epoch = &context.project.epochs[later].name;
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
    let message = message.say(&[("count", count.into()), ("corners", corners.into())]);
    context.warnings.notice(STEP, epoch, message);
}

/// Notes the variance components that lie at the upper end of their range.
fn report_components(context: &Context, later: EpochId, registered: &Registered) {
    let EstimatorRecord::Adjustment(adjustment) = &registered.estimator else {
        return;
    };
    let epoch = &context.project.epochs[later].name;
    for name in adjustment.variance_components.at_upper_bound() {
        let message = COMPONENT_AT_BOUND.say(&[("name", name.into())]);
        context.warnings.notice(STEP, epoch, message);
    }
}

/// Says how the stones moved on the mean.
fn report_mean_motion(context: &Context, later: EpochId, registered: &Registered, datum: &Datum) {
    let EstimatorRecord::Adjustment(adjustment) = &registered.estimator else {
        return;
    };
    let epoch = &context.project.epochs[later].name;
    context
        .warnings
        .notice(STEP, epoch, mean_motion(adjustment, datum));
}

/// Says what the stable areas show of the registration of the epochs, and what they do not.
fn report_datum(context: &Context, later: EpochId, registered: &Registered) {
    let epoch = &context.project.epochs[later].name;
    let named = context.project.settings.registration.stable.len();
    let cells = registered.epoch_errors.as_ref().map_or(0, |e| e.observations[2]);
    let is_stable = registered
        .epoch_errors
        .as_ref()
        .is_some_and(|e| e.datum == observers::Datum::Stable);

    if let Some(errors) = &registered.epoch_errors {
        for &area in &errors.moved_areas {
            let message = STABLE_MOVED.say(&[("area", name_of(context, registered, area))]);
            match area < named {
                true => context.warnings.skipped(STEP, epoch, message),
                false => context.warnings.notice(STEP, epoch, message),
            }
        }
        if let Some(lone) = &errors.lone_area {
            let shift_mm = Said::numbers(format!("{:.1}", 1e3 * lone.shift.norm()));
            let message = STABLE_ALONE.say(&[
                ("area", name_of(context, registered, lone.area)),
                ("shift_mm", shift_mm),
                ("sds", format!("{:.0}", lone.standard_deviations).into()),
            ]);
            context.warnings.notice(STEP, epoch, message);
        }
    }

    let values = [("cells", cells.to_string().into())];
    if named > 0 && !is_stable {
        context.warnings.skipped(STEP, epoch, STABLE_TOO_FEW.say(&values));
    }

    if named == 0 && context.project.settings.registration.auto_stable && !is_stable {
        context
            .warnings
            .notice(STEP, epoch, OFF_WALL_TOO_FEW.say(&values));
    }
}

/// A stable area as a sentence names it: those of the project first, then those off the wall.
pub fn name_of(context: &Context, registered: &Registered, area: usize) -> Said {
    let stable = &context.project.settings.registration.stable;
    if let Some(named) = stable.get(area) {
        return named.said(area + 1);
    }
    let off_wall = area.checked_sub(stable.len());
    match off_wall.and_then(|k| registered.off_wall.get(k)) {
        Some([low, high]) => {
            let middle: [f64; 3] = nalgebra::center(low, high).into();
            let place = Said::list(&middle.map(|m| format!("{m:.1}")));
            AREA_OFF_WALL.say(&[("place", place)])
        }
        None => NUMBERED_AREA.say(&[("n", (area + 1).to_string().into())]),
    }
}
