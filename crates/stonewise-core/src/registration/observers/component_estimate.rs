//! Estimation of the variances of the sources' errors, by restricted maximum likelihood (REML) from differences
//! within the epochs.

use super::components::{BOUNDS, COUNT, ObserverComponents, SensorClass};
use super::model::{Prior, Problem};
use crate::progress::{Interrupted, Progress};
use crate::registration::least_deviance::least_deviance;

/// The components under which the differences are most probable.
///
/// # Errors
/// The caller stopped the work.
pub(super) fn estimate(
    problem: &Problem,
    class: SensorClass,
    progress: &dyn Progress,
) -> Result<ObserverComponents, Interrupted> {
    let value = |log: &[f64; COUNT]| {
        let components = ObserverComponents::from_log(*log);
        let deviance = problem.deviance(&Prior::new(&components, 0.0), &components)?;
        Some(deviance + components.penalty(class))
    };
    let start = ObserverComponents::expected(class).to_log();
    let log = least_deviance(start, COUNT, &BOUNDS, value, progress)?;
    Ok(ObserverComponents::from_log(log))
}
