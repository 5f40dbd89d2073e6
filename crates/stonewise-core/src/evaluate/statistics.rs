//! Statistics of errors.

use crate::statistics::quantile;
use serde::{Deserialize, Serialize};

/// Makes the median absolute deviation estimate the standard deviation of a normal distribution.
const MAD_TO_SIGMA: f64 = 1.4826;

/// What errors in one direction look like, metres.
///
/// Components are signed, norms are not; `definitions` says which direction is which.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorStatistics {
    /// Number of errors.
    pub count: usize,
    /// Root of the mean square.
    pub rmse_m: f64,
    /// Mean: the bias of a signed component.
    pub mean_m: f64,
    /// Median of the errors with their sign.
    pub median_m: f64,
    /// 1.4826 times the median distance from the median.
    pub nmad_m: f64,
    /// 95th percentile of the absolute errors.
    pub p95_m: f64,
    /// Share of absolute errors beyond the outlier limit.
    pub outlier_rate: f64,
    /// RMSE of an estimator that always says "did not move".
    pub zero_predictor_rmse_m: f64,
}

impl ErrorStatistics {
    /// Statistics of errors, and of what was true in the same direction; `None` without errors.
    pub fn of(errors: &[f64], truths: &[f64], outlier_m: f64) -> Option<Self> {
        if errors.is_empty() {
            return None;
        }
        let n = errors.len() as f64;
        let sorted = sorted(errors.iter().copied());
        let median = quantile(&sorted, 0.5);
        let deviations = self::sorted(errors.iter().map(|e| (e - median).abs()));
        let absolute = self::sorted(errors.iter().map(|e| e.abs()));
        Some(Self {
            count: errors.len(),
            rmse_m: root_mean_square(errors),
            mean_m: errors.iter().sum::<f64>() / n,
            median_m: median,
            nmad_m: MAD_TO_SIGMA * quantile(&deviations, 0.5),
            p95_m: quantile(&absolute, 0.95),
            outlier_rate: absolute.iter().filter(|e| **e > outlier_m).count() as f64 / n,
            zero_predictor_rmse_m: root_mean_square(truths),
        })
    }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

fn root_mean_square(values: &[f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_match_a_calculation_by_hand() {
        let errors = [0.001, -0.003, 0.002, 0.030, 0.000];
        let truths = [0.03, 0.04, 0.0, 0.0, 0.0];
        let s = ErrorStatistics::of(&errors, &truths, 0.01).unwrap();
        assert_eq!(s.count, 5);
        // Squares in mm^2: 1 + 9 + 4 + 900 + 0 = 914, by 5 = 182.8.
        assert!((s.rmse_m - 182.8e-6f64.sqrt()).abs() < 1e-15);
        assert!((s.mean_m - 0.006).abs() < 1e-15);
        assert_eq!(s.median_m, 0.001);
        // Distances from the median in mm: 0, 4, 1, 29, 1; their median is 1.
        assert!((s.nmad_m - 1.4826e-3).abs() < 1e-15);
        // Absolute errors in mm: 0 1 2 3 30; rank 0.95 * 4 = 3.8 gives 3 + 0.8 * 27.
        assert!((s.p95_m - 24.6e-3).abs() < 1e-15);
        assert_eq!(s.outlier_rate, 0.2);
        assert!((s.zero_predictor_rmse_m - 5e-4f64.sqrt()).abs() < 1e-15);
        assert!(ErrorStatistics::of(&[], &[], 0.01).is_none());
    }
}
