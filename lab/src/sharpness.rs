//! How sharp and right normal distributions are that were claimed of errors (Gneiting & Raftery 2007).

use crate::figures::Z95;
use statrs::distribution::{Continuous, ContinuousCDF, Normal};
use std::f64::consts::PI;

/// One less the level of the intervals.
const ALPHA: f64 = 0.05;

/// Mean scores of errors of which a normal distribution about zero was claimed; the unit is that of the errors.
///
/// The lower a score, the better. Coverage alone is as good for intervals that are wide where errors are small and
/// narrow where they are large; scores are not.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sharpness {
    count: f64,
    crps: f64,
    interval: f64,
    square: f64,
}

impl Sharpness {
    /// Counts an error and its claimed standard deviation.
    pub fn add(&mut self, error: f64, sd: f64) {
        *self = self.with(&Self {
            count: 1.0,
            crps: crps(error, sd),
            interval: interval_score(error, sd),
            square: error * error,
        });
    }

    /// Both together.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        Self {
            count: self.count + other.count,
            crps: self.crps + other.crps,
            interval: self.interval + other.interval,
            square: self.square + other.square,
        }
    }

    pub fn crps(&self) -> f64 {
        self.crps / self.count
    }

    pub fn interval(&self) -> f64 {
        self.interval / self.count
    }

    /// The mean CRPS over that of the normal distribution whose standard deviation is the root mean square of the
    /// errors, if they had it: `rms / sqrt(pi)`.
    pub fn crps_ratio(&self) -> f64 {
        self.crps() / (self.rms() / PI.sqrt())
    }

    /// The same for the interval score: `4 / alpha phi(z) rms`.
    pub fn interval_ratio(&self) -> f64 {
        self.interval() / (4.0 / ALPHA * Normal::standard().pdf(Z95) * self.rms())
    }

    fn rms(&self) -> f64 {
        (self.square / self.count).sqrt()
    }
}

/// Continuous ranked probability score of a normal distribution about zero (eq. 21, its sign turned).
fn crps(error: f64, sd: f64) -> f64 {
    if sd <= 0.0 {
        return error.abs();
    }
    let (z, normal) = (error / sd, Normal::standard());
    sd * (z * (2.0 * normal.cdf(z) - 1.0) + 2.0 * normal.pdf(z) - 1.0 / PI.sqrt())
}

/// Score of the central 95 % interval about zero (eq. 43): its width, and a fine where the error lies beyond it.
fn interval_score(error: f64, sd: f64) -> f64 {
    let half = Z95 * sd;
    2.0 * half + 2.0 / ALPHA * (error.abs() - half).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: f64 = 1e-3;

    /// The integral of a function, by the middles of small steps.
    fn integral(of: impl Fn(f64) -> f64) -> f64 {
        let steps = -40_000..40_000;
        steps.map(|k| STEP * of((f64::from(k) + 0.5) * STEP)).sum()
    }

    /// CRPS as it is defined (eq. 20): the squared distance of the distribution from the step at the error.
    #[test]
    fn crps_is_the_integral_of_its_definition() {
        for (error, sd) in [(0.0, 1.0), (0.7, 1.0), (-2.5, 0.4), (3.0, 2.5)] {
            let claimed = Normal::new(0.0, sd).unwrap();
            let squared = |x: f64| (claimed.cdf(x) - f64::from(u8::from(x >= error))).powi(2);
            let expected = integral(squared);
            assert!((crps(error, sd) - expected).abs() < 1e-3, "{error} {sd}");
        }
        assert!((crps(-0.3, 0.0) - 0.3).abs() < 1e-12);
    }

    /// Of errors that have the claimed distribution, both ratios are one; of wider claims, more.
    #[test]
    fn right_claims_score_one() {
        let truth = Normal::new(0.0, 0.8).unwrap();
        let mean = |sd: f64| {
            let mut all = Sharpness::default();
            for k in 0..20_000 {
                all.add(truth.inverse_cdf((f64::from(k) + 0.5) / 20_000.0), sd);
            }
            [all.crps_ratio(), all.interval_ratio()]
        };
        assert!(mean(0.8).iter().all(|ratio| (ratio - 1.0).abs() < 2e-3));
        assert!(mean(0.5).iter().chain(&mean(1.2)).all(|ratio| *ratio > 1.01));
        // E|X - Y| - E|Y - Y'| / 2 of normal X and Y.
        let wide = (2.0_f64.sqrt() * 0.8_f64.hypot(1.2) - 1.2) / 0.8;
        assert!((mean(1.2)[0] - wide).abs() < 2e-3);
    }
}
