//! What is known about the registration of a later epoch against the first.

use super::Registered;
use crate::project::Project;
use crate::results::records::{Datum, DatumState, SourceError};
use crate::texts::Said;
use crate::texts::notices::{
    DATUM_ALIGNED, DATUM_ONE_SURVEY, DATUM_SOURCES, DATUM_STABLE, DATUM_STATED, REGISTRATION_UNKNOWN,
};
use nalgebra::Matrix6;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::registration::observers::{self, EpochErrors};
use stonewise_core::stone::{Stone, middle};

/// Whether the later epoch is a part of the survey of the first, the reference, as `split` writes it.
pub(super) fn is_one_survey(project: &Project, epochs: Pair<EpochId>) -> bool {
    epochs.first.is_reference() && project.epochs[epochs.later].is_of_reference_survey()
}

/// The registration error of a later epoch, from the first of these that there is: stable areas, the error
/// that the project states, differences between the sources of each epoch.
///
/// `stones`: of the first epoch; their middle is the centre of a stated
/// error.
pub fn datum(project: &Project, epochs: Pair<EpochId>, registered: &Registered, stones: &[Stone]) -> Datum {
    let mut datum = of_errors(project, epochs, registered.epoch_errors.as_ref(), stones);
    if let Some(errors) = &registered.epoch_errors {
        let names = epochs.map(|e| project.epochs[e].name.clone()).into_array();
        datum.sources = errors
            .sources
            .iter()
            .map(|s| SourceError {
                epoch: names[s.epoch].clone(),
                source: s.name.clone(),
                error_m: s.against_epoch.into(),
                sd_m: s.sd.into(),
            })
            .collect();
    }
    datum.recorded(project.settings.report.language)
}

fn of_errors(
    project: &Project,
    epochs: Pair<EpochId>,
    errors: Option<&EpochErrors>,
    stones: &[Stone],
) -> Datum {
    let known = |state, errors: &EpochErrors, note| {
        Datum::known(state, &errors.rigid.centre, &errors.rigid.covariance, note)
    };
    let shift_mm = |errors: &EpochErrors| 1e3 * errors.rigid.error.fixed_rows::<3>(0).norm();

    if let Some(errors) = errors.filter(|e| e.datum == observers::Datum::Stable) {
        let note = DATUM_STABLE.say(&[("error_mm", Said::numbers(format!("{:.2}", shift_mm(errors))))]);
        return known(DatumState::Stable, errors, note);
    }

    let centre = middle(stones);
    if project.is_aligned(epochs.later) {
        return Datum::unknown(&centre, &DATUM_ALIGNED);
    }

    if let Some(error_m) = project.settings.registration.epoch_error_m {
        // Both epochs carry the error of their registration.
        let variance = 2.0 * error_m * error_m;
        let covariance = Matrix6::from_diagonal(&[variance, variance, variance, 0.0, 0.0, 0.0].into());
        let note = DATUM_STATED.say(&[("error_mm", Said::numbers(format!("{:.1}", 1e3 * error_m)))]);
        return Datum::known(DatumState::Stated, &centre, &covariance, note);
    }

    if is_one_survey(project, epochs)
        && let Some(errors) = errors
    {
        return known(DatumState::Stated, errors, Said::from(&DATUM_ONE_SURVEY));
    }

    if let Some(errors) = errors.filter(|e| e.datum == observers::Datum::Sources) {
        let shared_mm = Said::numbers(format!("{:.1}", 1e3 * errors.shared_error_m));
        let note = DATUM_SOURCES.say(&[("error_mm", shared_mm)]);
        return known(DatumState::Sources, errors, note);
    }

    Datum::unknown(&centre, &REGISTRATION_UNKNOWN)
}
