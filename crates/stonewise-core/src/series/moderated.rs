//! Variance factors of few degrees of freedom, which stones lend each other.

use crate::statistics::{median, student_95};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};
use statrs::function::gamma::digamma;
use std::collections::{BTreeMap, BTreeSet};

/// Half the width of a normal 95 % interval in standard deviations.
const Z: f64 = 1.959_963_984_540_054;
/// Degrees of freedom beyond which a law is the normal one.
const NORMAL_FROM: f64 = 1e6;

/// How much larger errors are than claimed, of a component of all stones: the squared residuals of a stone over their
/// claimed variance are a variance of its own, drawn from a scaled inverse chi-square distribution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct VarianceFactor {
    /// Variance factor of a typical stone; at least 1.
    pub factor: f64,
    /// For how many degrees of freedom it counts beside a stone's own; null: all stones err alike.
    pub freedom: Option<f64>,
}

impl VarianceFactor {
    /// From the sums of squared standardised residuals of stones with their degrees of freedom. Without any, the
    /// claimed variances hold.
    ///
    /// Source: Smyth 2004, "Linear models and empirical Bayes methods", section 6.2: moments of the logarithms.
    pub(super) fn of(residuals: &[(f64, usize)]) -> Self {
        let of_stone = |(sum, freedom): &(f64, usize)| {
            let half = *freedom as f64 / 2.0;
            let variance = sum / *freedom as f64;
            (*freedom > 0 && variance > 0.0)
                .then(|| (variance.ln() - digamma(half) + half.ln(), trigamma(half)))
        };

        let logs: Vec<(f64, f64)> = residuals.iter().filter_map(of_stone).collect();
        let count = logs.len() as f64;
        if logs.len() < 2 {
            return Self {
                factor: 1.0,
                freedom: None,
            };
        }

        let mean = logs.iter().map(|l| l.0).sum::<f64>() / count;
        let excess = logs
            .iter()
            .map(|l| (l.0 - mean).powi(2) / (count - 1.0) - l.1 / count)
            .sum::<f64>();
        let (log, freedom) = match excess > 0.0 {
            true => {
                let half = inverse_trigamma(excess);
                (mean + digamma(half) - half.ln(), Some(2.0 * half))
            }
            false => (mean, None),
        };

        Self {
            factor: log.exp().max(1.0),
            freedom,
        }
    }

    /// The factor of all stones from the median of theirs, which stones that fit no model do not change; see
    /// [`Self::of`].
    pub(super) fn typical(residuals: &[(f64, usize)]) -> Self {
        // Few freedoms are unlike, and a quantile is sought numerically.
        let freedoms: BTreeSet<usize> = residuals.iter().map(|r| r.1).collect();
        let expected = |freedom: usize| {
            let law = ChiSquared::new(freedom as f64).ok()?;
            Some((freedom, law.inverse_cdf(0.5)))
        };
        let expected: BTreeMap<usize, f64> = freedoms.into_iter().filter_map(expected).collect();
        let of_stone = |(sum, freedom): &(f64, usize)| Some(sum / expected.get(freedom)?);
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

/// Two-sided probability of a value at least this far from zero, in standard deviations.
pub(super) fn p_value(value: f64, variance: f64, factor: f64, freedom: f64) -> f64 {
    let t = -(value / (variance * factor).sqrt()).abs();
    let tail = match freedom < NORMAL_FROM {
        true => StudentsT::new(0.0, 1.0, freedom).map_or(0.5, |law| law.cdf(t)),
        false => Normal::standard().cdf(t),
    };
    (2.0 * tail).min(1.0)
}

/// Second derivative of the logarithm of the gamma function; asymptotic series (Abramowitz & Stegun 6.4.12) beyond a
/// recurrence.
fn trigamma(x: f64) -> f64 {
    let (mut x, mut sum) = (x, 0.0);
    while x < 30.0 {
        sum += 1.0 / (x * x);
        x += 1.0;
    }
    let inverse = 1.0 / x;
    let square = inverse * inverse;
    sum + inverse * (1.0 + inverse / 2.0 + square * (1.0 / 6.0 - square * (1.0 / 30.0 - square / 42.0)))
}

/// Its inverse, by Newton's method on 1 / trigamma, which is convex (Smyth 2004, appendix).
fn inverse_trigamma(value: f64) -> f64 {
    if value > 1e7 {
        return 1.0 / value.sqrt();
    }
    if value < 1e-6 {
        return 1.0 / value;
    }
    let mut x = 0.5 + 1.0 / value;
    for _ in 0..50 {
        let at = trigamma(x);
        let slope = (trigamma(x * 1.000_01) - trigamma(x * 0.999_99)) / (x * 2e-5);
        let step = at * (1.0 - at / value) / slope;
        x = (x + step).max(x / 2.0);
        if (step / x).abs() < 1e-10 {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::normal_pair;
    use crate::statistics::split_mix;

    #[test]
    fn trigamma_has_its_known_values_and_its_inverse() {
        let known = std::f64::consts::PI.powi(2) / 6.0;
        assert!((trigamma(1.0) - known).abs() < 1e-12);
        assert!((trigamma(0.5) - 3.0 * known).abs() < 1e-12);
        for x in [0.1, 0.5, 1.0, 3.7, 40.0] {
            let found = inverse_trigamma(trigamma(x));
            assert!((found / x - 1.0).abs() < 1e-7, "{x}: {found}");
        }
    }

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
    fn claimed_variances_are_not_undercut() {
        let factor = VarianceFactor::of(&drawn(500, |_| 0.2));
        assert_eq!(factor.factor, 1.0);
        assert_eq!(factor.at(0.1, 3).0, 1.0);
    }
}
