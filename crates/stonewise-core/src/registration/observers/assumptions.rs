//! What is held while the errors of the epochs are solved for.

use super::components::{ObserverComponents, SensorClass};
use super::model::{Prior, Problem, Unknowns};
use super::observation::Observation;

/// Factor on the error of the whole epoch where areas alone are to determine it. With it left open,
/// directions that no area sees would seem to show anything.
pub(super) const WIDE: f64 = 5.0;
/// An error of the whole epoch this many times as large as assumed shows that the assumption does not hold.
const SURPRISING: f64 = 2.0;

/// Standard deviations of all errors.
#[derive(Clone, Copy)]
pub(super) struct Model {
    pub components: ObserverComponents,
    /// Of the later epoch against the reference as a whole, per axis, metres.
    pub whole_m: f64,
    /// Error of the later epoch where it is left open, so that areas alone determine it, metres.
    pub open_m: f64,
    /// Of a source on a plane of a stable area, metres.
    pub plane_m: f64,
    pub class: SensorClass,
}

impl Model {
    /// With all errors of the sources times `factor`.
    pub fn scaled(&self, factor: f64) -> (Prior, ObserverComponents) {
        let components = self.components.scaled(factor);
        let prior = Prior::with_planes(&components, self.whole_m, self.plane_m);
        (prior, components)
    }

    /// With an error of the whole epoch so wide that areas alone determine it.
    pub fn opened(&self) -> (Prior, ObserverComponents) {
        self.with_whole(self.open_m)
    }

    /// With another error of the whole epoch, metres.
    fn with_whole(&self, whole_m: f64) -> (Prior, ObserverComponents) {
        let prior = Prior::with_planes(&self.components, whole_m, self.plane_m);
        (prior, self.components)
    }

    /// With the error of the whole epoch as large as stable areas show it, where that is far more than is
    /// assumed: an assumption that does not hold would pull the error towards none.
    pub fn widened(self, unknowns: &Unknowns, observations: &[&Observation]) -> Self {
        let (prior, components) = self.opened();
        let solution = Problem::new(unknowns, observations).solve(&prior, &components);
        let shown_m = solution.map_or(0.0, |s| s.mean.fixed_rows::<3>(unknowns.whole()).amax());
        match shown_m > SURPRISING * self.whole_m && self.whole_m > 0.0 {
            true => Self {
                whole_m: shown_m.max(self.open_m),
                open_m: shown_m.max(self.open_m),
                ..self
            },
            false => self,
        }
    }
}

/// Standard deviation per axis of what all sources of the epochs share, later epoch against reference,
/// metres.
///
/// `stated_m`: of one epoch, as the project states it, which then holds. Otherwise what is assumed for the
/// class of the sensor and, where `components` say that sources agree better than they could by themselves,
/// the rest, which an adjustment of the sources to each other hides in their mean. `counts`: sources of each
/// epoch.
pub(super) fn whole_m(
    stated_m: Option<f64>,
    class: SensorClass,
    components: Option<&ObserverComponents>,
    counts: [usize; 2],
) -> f64 {
    if let Some(stated_m) = stated_m {
        return 2f64.sqrt() * stated_m;
    }
    let hidden = components.map_or(0.0, |c| {
        (class.least_m().powi(2) - c.translation_m.powi(2)).max(0.0)
    });
    let of_epoch = |count: usize| class.shared_error_m().powi(2) + hidden / count.max(1) as f64;
    counts.into_iter().map(of_epoch).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_that_agree_too_well_hide_their_error_in_their_mean() {
        let class = SensorClass::Airborne;
        let with = |translation_m| ObserverComponents {
            translation_m,
            ..ObserverComponents::expected(class)
        };
        let whole = |translation_m, counts| whole_m(None, class, Some(&with(translation_m)), counts);
        let shared = class.shared_error_m().powi(2);
        // Strips 4 mm apart were not adjusted; without any difference all of 3 mm is hidden.
        assert!((whole(4e-3, [3, 3]) - (2.0 * shared).sqrt()).abs() < 1e-12);
        let expected = (2.0 * shared + 9e-6 / 3.0 + 9e-6 / 4.0).sqrt();
        assert!((whole(0.0, [3, 4]) - expected).abs() < 1e-12);
        assert!((whole_m(None, class, None, [1, 1]) - (2.0 * shared).sqrt()).abs() < 1e-12);
        assert!((whole_m(Some(1e-3), class, Some(&with(0.0)), [3, 3]) - 2f64.sqrt() * 1e-3).abs() < 1e-12);
    }
}
