//! A stone's motion, and how it departs from its neighbours', with looseness averaged out.

use super::candidate::Moving;
use super::field::{covariance_against, posterior};
use super::observation::NormalEquations;
use super::solution::Solution;
use super::state::{Adjustment, StoneState};
use super::stone_vector::{Matrix9, StoneVector, Vector9};
use nalgebra::Matrix3;
use statrs::distribution::{ContinuousCDF, Normal};

/// Share of the results that intervals of 1.96 standard deviations leave outside.
const OUTSIDE: f64 = 0.05;

/// A stone's motion with its looseness averaged out, in its frame.
pub(crate) struct Estimate {
    /// About the common translation.
    pub mean: StoneVector,
    pub covariance: Matrix9,
    /// Covariance of the translation against what the neighbours predict, m^2.
    pub relative_covariance: Matrix3<f64>,
    /// Probability that the stone is loose, if `covariance` is widened for it ([`widening`]); else 0.
    pub missed: f64,
    /// Derivative of the motion with respect to the motion of the field at the stone.
    pub by_field: Matrix9,
}

/// What holds of a stone if it moved in one of the ways that are possible.
struct Case {
    probability: f64,
    mean: StoneVector,
    covariance: Matrix9,
    relative_covariance: Matrix3<f64>,
    by_field: Matrix9,
}

impl Adjustment {
    /// A stone's motion about the common translation.
    ///
    /// Where the stone is not followed on its own, it moves with its neighbours, and its covariance is
    /// widened for the chance that it does not ([`widening`]). Otherwise mean and covariance are those of the
    /// mixture of three cases: it moves with the field, it is loose, or its clouds show it at a wrong place, and
    /// only photos and neighbours say where it is.
    ///
    /// `shared`: variances of errors that a stone's points share, against its neighbours; they are in the
    /// relative covariance.
    pub fn estimate(&self, i: usize, solution: &Solution, shared: &[f64; 9]) -> Estimate {
        let (stone, equations) = (&self.stones[i], &solution.equations[i]);
        let prediction = &solution.field.from_others[i];
        // What counts as an error might be a motion after all.
        let slide_m2 = self.undetected_slide_m(i).powi(2);
        let case = |probability: f64, equations: &NormalEquations, own: &[f64; 9], slide_m2: f64| {
            let found = posterior(equations, prediction, own);
            let mut covariance = found.covariance;
            let mut relative_covariance = covariance_against(&found, prediction, own, shared);
            for k in 0..2 {
                covariance[(k, k)] += slide_m2;
                relative_covariance[(k, k)] += slide_m2;
            }
            Case {
                probability,
                mean: found.mean,
                covariance,
                relative_covariance,
                by_field: by_field(equations, own),
            }
        };
        let own = self.prior.own_variances();
        let p_loose = self.p_loose(stone);
        let Some(at_own) = equations.on_own.as_ref().filter(|_| stone.on_own.is_some()) else {
            let tied = case(1.0, &equations.with_field, &own, slide_m2);
            let factor = widening(p_loose);
            return Estimate {
                mean: tied.mean,
                covariance: tied.covariance * factor,
                relative_covariance: tied.relative_covariance * factor,
                missed: p_loose,
                by_field: tied.by_field,
            };
        };
        let p_wrong = stone.p_wrong();
        let p_tied = 1.0 - p_loose - p_wrong;
        let photos = self.observed_by_photos(i, Moving::WithField);
        let without_clouds = photos.unwrap_or_else(NormalEquations::nothing);
        Estimate::of(&[
            case(p_tied, &equations.with_field, &own, slide_m2),
            case(p_loose, at_own, &self.prior.loose_variances(), 0.0),
            case(p_wrong, &without_clouds, &own, slide_m2),
        ])
    }

    /// Probability that a stone is loose; what is expected of any stone where its own observations cannot
    /// tell.
    pub fn p_loose(&self, stone: &StoneState) -> f64 {
        match stone.is_undecided {
            true => self.prior.loose.share,
            false => (1.0 - stone.p_with_field) * (1.0 - stone.doubt),
        }
    }
}

impl Estimate {
    /// Mean and covariance over these cases.
    fn of(cases: &[Case]) -> Self {
        let mut mean = StoneVector::zeros();
        for case in cases {
            mean = mean + case.mean.scaled(case.probability);
        }
        let mut sum = Self {
            mean,
            covariance: Matrix9::zeros(),
            relative_covariance: Matrix3::zeros(),
            missed: 0.0,
            by_field: Matrix9::zeros(),
        };
        for case in cases {
            let p = case.probability;
            let apart = *(case.mean - mean).unknowns();
            let between = apart * apart.transpose();
            sum.covariance += (case.covariance + between) * p;
            sum.relative_covariance += (case.relative_covariance + between.fixed_view::<3, 3>(0, 0)) * p;
            sum.by_field += case.by_field * p;
        }
        sum
    }
}

/// Derivative of a stone's motion with respect to the field's motion. W are the variances of the stone's own
/// motion, H is the information of its observations. The stone departs from the field by (H + W^-1)^-1 H
/// times the difference that its observations show, so it follows the field with the share (I + W H)^-1.
pub(crate) fn by_field(equations: &NormalEquations, own: &[f64; 9]) -> Matrix9 {
    let own = Matrix9::from_diagonal(&Vector9::from(*own));
    (Matrix9::identity() + own * equations.information)
        .try_inverse()
        .unwrap_or_else(Matrix9::identity)
}

/// Factor on the covariance of a stone that moves with its neighbours, for the small probability `p_loose`
/// that it does not: 1.96 standard deviations then hold the motion in 95 of 100 cases even if they miss every
/// loose one.
///
/// Stones of a larger probability than nine tenths of what intervals leave outside are followed on their own;
/// the factor grows no further there.
pub(crate) fn widening(p_loose: f64) -> f64 {
    let missed = p_loose.clamp(0.0, 0.9 * OUTSIDE);
    let outside = (OUTSIDE - missed) / (1.0 - missed);
    let quantile = |outside: f64| Normal::standard().inverse_cdf(1.0 - 0.5 * outside);
    (quantile(outside) / quantile(OUTSIDE)).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widened_intervals_hold_their_share_of_a_mixture() {
        let law = Normal::standard();
        for p_loose in [0.0, 1e-4, 0.01, 0.03, 0.045] {
            let reach = law.inverse_cdf(0.975) * widening(p_loose).sqrt();
            let held = (1.0 - p_loose) * (1.0 - 2.0 * law.sf(reach));
            assert!((held - 0.95).abs() < 1e-9, "{p_loose}: {held}");
        }
        assert!((widening(0.0) - 1.0).abs() < 1e-12);
        assert_eq!(widening(0.5), widening(0.045));
    }
}
