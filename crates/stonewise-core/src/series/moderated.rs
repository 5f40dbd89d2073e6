//! Variance factors of few degrees of freedom, which stones lend each other.

use crate::statistics::{median, student_95};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, Continuous, ContinuousCDF, FisherSnedecor, Normal, StudentsT};
use std::collections::BTreeMap;

/// Half the width of a normal 95 % interval in standard deviations.
const Z: f64 = 1.959_963_984_540_054;
/// Degrees of freedom beyond which a law is the normal one.
const NORMAL_FROM: f64 = 1e6;

/// Degrees of freedom that are tried, and from which on stones count as alike.
const FREEDOMS: [f64; 14] = [
    1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0, ALIKE,
];
const ALIKE: f64 = 1000.0;

/// How much larger errors are than claimed, of a component of all stones: the squared residuals of a stone over their
/// claimed variance are a variance of its own, drawn from a scaled inverse chi-square distribution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct VarianceFactor {
    /// Of a typical stone; at least 1.
    pub factor: f64,
    /// For how many degrees of freedom it counts beside a stone's own; null: all stones err alike.
    pub freedom: Option<f64>,
}

impl VarianceFactor {
    /// From the sums of squared standardised residuals of stones with their degrees of freedom. Without any, the
    /// claimed variances hold.
    ///
    /// With the factor from the median, the freedom is the most likely one of those tried: s_i^2 / factor follows the
    /// F distribution (Smyth 2004, "Linear models and empirical Bayes methods", section 3). Of stones that err less
    /// than is typical only their number counts, because no factor goes below 1.
    pub(super) fn of(residuals: &[(f64, usize)]) -> Self {
        let typical = Self::typical(residuals);
        let mut of_freedom: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for (sum, freedom) in residuals.iter().filter(|r| r.1 > 0) {
            let ratio = sum / (*freedom as f64 * typical.factor);
            of_freedom.entry(*freedom).or_default().push(ratio);
        }
        let likelihood = |prior: f64| -> Option<f64> {
            let mut sum = 0.0;
            for (freedom, ratios) in &of_freedom {
                let law = FisherSnedecor::new(*freedom as f64, prior).ok()?;
                let below = law.cdf(1.0).ln();
                let of_stone = |ratio: &f64| match *ratio < 1.0 {
                    true => below,
                    false => law.ln_pdf(*ratio),
                };
                sum += ratios.iter().map(of_stone).sum::<f64>();
            }
            Some(sum)
        };
        let tried = FREEDOMS
            .into_iter()
            .filter_map(|prior| Some((prior, likelihood(prior)?)));
        let likeliest = tried.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(prior, _)| prior);
        Self {
            freedom: likeliest.filter(|prior| *prior < ALIKE),
            ..typical
        }
    }

    /// The factor of all stones from the median of theirs, which stones that fit no model do not change; see
    /// [`Self::of`].
    pub(super) fn typical(residuals: &[(f64, usize)]) -> Self {
        let of_stone = |(sum, freedom): &(f64, usize)| {
            let law = ChiSquared::new(*freedom as f64).ok()?;
            Some(sum / law.inverse_cdf(0.5))
        };
        let mut factors: Vec<f64> = residuals.iter().filter_map(of_stone).collect();
        Self {
            factor: median(&mut factors).unwrap_or(1.0).max(1.0),
            freedom: None,
        }
    }

    /// The factor of a stone and its degrees of freedom. Claimed variances are never undercut.
    pub(super) fn at(&self, residuals: f64, freedom: usize) -> (f64, f64) {
        let own = freedom as f64;
        match self.freedom {
            None => (self.factor, f64::INFINITY),
            Some(prior) => {
                let factor = (prior * self.factor + residuals) / (prior + own);
                (factor.max(1.0), prior + own)
            }
        }
    }
}

/// Standard deviation of which 1.96 hold 95 % of Student's law.
pub(super) fn sd_of(variance: f64, factor: f64, freedom: f64) -> f64 {
    let widening = match freedom < NORMAL_FROM {
        true => student_95(freedom, Z) / Z,
        false => 1.0,
    };
    (variance * factor).sqrt() * widening
}

/// Probability of a value at least so many standard deviations from zero.
pub(super) fn p_value(value: f64, variance: f64, factor: f64, freedom: f64) -> f64 {
    let t = -(value / (variance * factor).sqrt()).abs();
    let tail = match freedom < NORMAL_FROM {
        true => StudentsT::new(0.0, 1.0, freedom).map_or(0.5, |law| law.cdf(t)),
        false => Normal::standard().cdf(t),
    };
    (2.0 * tail).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::normal_pair;
    use crate::statistics::split_mix;

    /// Squared residuals of stones whose own factor is `factors(i)`, of three degrees of freedom.
    fn drawn(count: u64, factor: impl Fn(u64) -> f64) -> Vec<(f64, usize)> {
        let uniform = |k: u64| split_mix(k) as f64 / u64::MAX as f64;
        let of = |i: u64| {
            let normal = |k: u64| normal_pair([uniform(10 * i + 2 * k), uniform(10 * i + 2 * k + 1)])[0];
            let sum: f64 = (0..3).map(|k| normal(k).powi(2)).sum();
            (sum * factor(i), 3)
        };
        (0..count).map(of).collect()
    }

    #[test]
    fn stones_that_err_alike_have_one_factor() {
        let factor = VarianceFactor::of(&drawn(4000, |_| 2.25));
        assert!((factor.factor / 2.25 - 1.0).abs() < 0.06, "{factor:?}");
        assert!(factor.freedom.is_none_or(|f| f > 40.0), "{factor:?}");
    }

    #[test]
    fn stones_that_err_unlike_each_other_keep_more_of_their_own() {
        // Every fifth stone errs three times as much.
        let factor = VarianceFactor::of(&drawn(4000, |i| if i % 5 == 0 { 9.0 } else { 1.0 }));
        assert!(factor.freedom.is_some_and(|f| f < 10.0), "{factor:?}");
        let (loud, freedom) = factor.at(27.0, 3);
        assert!(loud > 3.0 && freedom > 3.0, "{loud} {freedom}");
    }

    #[test]
    fn stones_that_err_less_than_claimed_do_not_make_the_others_uncertain() {
        // Every third stone errs as claimed, the others a tenth of it.
        let factor = VarianceFactor::of(&drawn(300, |i| if i % 3 == 0 { 1.0 } else { 0.01 }));
        assert_eq!(factor.factor, 1.0);
        assert!(factor.freedom.is_none_or(|f| f > 20.0), "{factor:?}");
    }

    #[test]
    fn claimed_variances_are_not_undercut() {
        let factor = VarianceFactor::of(&drawn(500, |_| 0.2));
        assert_eq!(factor.factor, 1.0);
        assert_eq!(factor.at(0.1, 3).0, 1.0);
    }
}
