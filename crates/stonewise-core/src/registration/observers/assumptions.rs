//! What is held while the errors of the epochs are solved for.

use super::components::{ObserverComponents, SensorClass};
use super::model::{Prior, Problem, Unknowns};
use super::observation::Observation;
use crate::switches::switchable;
use nalgebra::{Matrix3, Vector3};

/// Factor on the error of the whole epoch where areas alone are to determine it. With it left open,
/// directions that no area sees would seem to show anything.
pub(super) const WIDE: f64 = 5.0;
/// An error of the whole epoch this many times as large as assumed shows that the assumption does not hold.
const SURPRISING: f64 = 2.0;

/// Standard deviations of all errors.
#[derive(Clone, Copy)]
pub(super) struct Model {
    pub components: ObserverComponents,
    /// Covariance of the error of the later epoch against the reference as a whole, m^2.
    pub whole: Matrix3<f64>,
    /// Covariance of the error of the later epoch as a whole where it is left open, so that areas alone determine it,
    /// m^2.
    pub open: Matrix3<f64>,
    /// Standard deviation of a source's error on a plane of a stable area, metres.
    pub plane_m: f64,
    pub class: SensorClass,
}

impl Model {
    /// The assumptions with all errors of the sources times `factor`.
    pub fn scaled(&self, factor: f64) -> (Prior, ObserverComponents) {
        let components = self.components.scaled(factor);
        let prior = Prior::with_planes(&components, self.whole, self.plane_m);
        (prior, components)
    }

    /// The assumptions with an error of the whole epoch so wide that areas alone determine it.
    pub fn opened(&self) -> (Prior, ObserverComponents) {
        let prior = Prior::with_planes(&self.components, self.open, self.plane_m);
        (prior, self.components)
    }

    /// The model with the error of the whole epoch as large as stable areas show it, where that is far more than is
    /// assumed: an assumption that does not hold would pull the error towards none. Along what the areas show worse
    /// than it is assumed, the assumption holds: no area makes the expected error larger.
    pub fn widened(self, unknowns: &Unknowns, observations: &[&Observation]) -> Self {
        switchable!("obs_widened", self);
        let (prior, components) = self.opened();
        let Some(solution) = Problem::new(unknowns, observations).solve(&prior, &components) else {
            return self;
        };
        let shown = solution.mean.fixed_rows::<3>(unknowns.whole()).into_owned();
        let covariance = solution
            .covariance
            .fixed_view::<3, 3>(unknowns.whole(), unknowns.whole())
            .into_owned();
        self.widened_to(&shown, &covariance)
    }

    /// The model with an error of the whole epoch that was found with this covariance, left open.
    fn widened_to(self, shown: &Vector3<f64>, covariance: &Matrix3<f64>) -> Self {
        let eigen = (0.5 * (covariance + covariance.transpose())).symmetric_eigen();
        let (mut seen, mut surprise) = (Vector3::zeros(), 0.0);
        for (variance, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            let assumed = direction.dot(&(self.whole * direction));
            if *variance < assumed {
                let along = direction.dot(shown);
                seen += direction * along;
                surprise += along * along / (assumed + variance);
            }
        }
        let mut wider = self;
        if surprise > SURPRISING * SURPRISING {
            let direction = seen.normalize();
            let widen = |m: &mut Matrix3<f64>| {
                let missing = seen.norm_squared() - direction.dot(&(*m * direction));
                *m += direction * direction.transpose() * missing.max(0.0);
            };
            widen(&mut wider.whole);
            widen(&mut wider.open);
        }
        wider
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
    fn an_error_is_widened_along_what_is_seen_alone() {
        let class = SensorClass::Airborne;
        let model = Model {
            components: ObserverComponents::expected(class),
            whole: Matrix3::identity() * 9e-6,
            open: Matrix3::identity() * 225e-6,
            plane_m: 0.0,
            class,
        };
        // Seen to a millimetre along an axis between x and y, hardly along the others.
        let axis = Vector3::new(0.6, 0.8, 0.0);
        let covariance = Matrix3::identity() * 150e-6 - axis * axis.transpose() * 149e-6;
        let beside = Vector3::new(-0.8, 0.6, 0.0) * 0.013;
        let near = model.widened_to(&(axis * 0.005 + beside), &covariance);
        assert_eq!([near.whole, near.open], [model.whole, model.open]);
        let far_beside = model.widened_to(&(axis * 0.005 + beside * 10.0), &covariance);
        assert_eq!([far_beside.whole, far_beside.open], [model.whole, model.open]);
        let far = model.widened_to(&(axis * 0.02 + beside), &covariance);
        let expected = model.whole + axis * axis.transpose() * (400e-6 - 9e-6);
        assert!((far.whole - expected).norm() < 1e-9);
        assert!((axis.dot(&(far.open * axis)) - 400e-6).abs() < 1e-9);
        // An error that is stated as none stays none.
        let none = Model {
            whole: Matrix3::zeros(),
            open: Matrix3::zeros(),
            ..model
        };
        assert_eq!(none.widened_to(&(axis * 0.02), &covariance).whole, none.whole);
    }

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
