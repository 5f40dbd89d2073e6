//! Whether claimed uncertainties are right.

use crate::statistics::quantile;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// 95 % quantile of chi-square with 3 degrees of freedom.
const CHI_SQUARE_95: f64 = 7.814_727_903_251_179;

/// Claims against truth.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Share of true components inside their 95 % interval; 0.95 is right.
    pub coverage_95: Coverage,
    /// Samples whose covariance can be inverted, on which the normalised errors rest.
    pub chi_square_count: usize,
    /// Mean of e' C^-1 e; 3 is right.
    pub chi_square_mean: Option<f64>,
    /// Median of e' C^-1 e; 2.37 is right.
    pub chi_square_median: Option<f64>,
    /// Share of e' C^-1 e below 7.81; 0.95 is right.
    pub chi_square_share_95: Option<f64>,
}

/// Coverage of intervals per axis; `None` where no interval was claimed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    /// Along the dam.
    pub along: Option<f64>,
    /// Up the face.
    pub up: Option<f64>,
    /// Out of plane.
    pub out: Option<f64>,
}

/// An error along three axes, with what was claimed about it.
pub(super) struct Claim {
    /// Estimate minus truth.
    pub error: Vector3<f64>,
    /// Half-widths of the 95 % intervals; `None` where nothing is claimed.
    pub half_width: [Option<f64>; 3],
    /// Squared Mahalanobis length of the error; `None` without a positive definite covariance.
    pub normalised: Option<f64>,
}

impl Calibration {
    /// Counts how often the truth lies where it was claimed to lie.
    pub(super) fn of(claims: &[Claim]) -> Self {
        let mut normalised: Vec<f64> = claims.iter().filter_map(|c| c.normalised).collect();
        normalised.sort_by(f64::total_cmp);
        let n = normalised.len();
        let share = |count: usize| count as f64 / n as f64;
        Self {
            coverage_95: Coverage {
                along: covered(claims, 0),
                up: covered(claims, 1),
                out: covered(claims, 2),
            },
            chi_square_count: n,
            chi_square_mean: (n > 0).then(|| normalised.iter().sum::<f64>() / n as f64),
            chi_square_median: (n > 0).then(|| quantile(&normalised, 0.5)),
            chi_square_share_95: (n > 0)
                .then(|| share(normalised.iter().filter(|x| **x <= CHI_SQUARE_95).count())),
        }
    }
}

fn covered(claims: &[Claim], axis: usize) -> Option<f64> {
    let inside: Vec<bool> = claims
        .iter()
        .filter_map(|c| Some(c.error[axis].abs() <= c.half_width[axis]?))
        .collect();
    let hits = inside.iter().filter(|hit| **hit).count();
    (!inside.is_empty()).then(|| hits as f64 / inside.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::{MotionSample, StoneOutcome};
    use crate::id::StoneId;
    use nalgebra::{Matrix3, Point3, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    /// Samples whose errors have `scale` times the claimed covariance.
    fn samples(scale: f64) -> Vec<MotionSample> {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut normal = || {
            let sum: f64 = (0..12).map(|_| rng.random_range(0.0..1.0)).sum();
            sum - 6.0
        };
        let root = Matrix3::new(2.0, 0.0, 0.0, 0.7, 1.0, 0.0, -0.4, 0.3, 0.5) * 1e-3;
        let wall = Vector3::new(1.0, 0.4, 0.2);
        (0..20_000)
            .filter_map(|_| {
                let error = root * Vector3::new(normal(), normal(), normal()) * scale;
                let truth = Vector3::new(0.01, 0.0, -0.02);
                let outcome = StoneOutcome {
                    stone: StoneId(1),
                    centroid: Point3::origin(),
                    normal: wall,
                    displacement: Some(truth + error),
                    covariance: Some(root * root.transpose()),
                    covariance_without_datum: None,
                    rotation: None,
                    datum_known: true,
                    detection_limit_m: None,
                    significant: None,
                    loose: None,
                };
                MotionSample::of_stone(&outcome, &wall, truth, None)
            })
            .collect()
    }

    #[test]
    fn honest_claims_are_found_honest() {
        let right = Calibration::of(&MotionSample::claims(&samples(1.0)));
        let c = &right.coverage_95;
        for share in [c.along, c.up, c.out, right.chi_square_share_95] {
            assert!((share.unwrap() - 0.95).abs() < 0.006, "{right:?}");
        }
        assert!((right.chi_square_mean.unwrap() - 3.0).abs() < 0.05);
        assert!((right.chi_square_median.unwrap() - 2.366).abs() < 0.06);
    }

    #[test]
    fn claims_that_are_half_too_small_are_found_out() {
        let proud = Calibration::of(&MotionSample::claims(&samples(2.0)));
        // A normal error of twice the claim stays inside with probability erf(0.98 / sqrt 2) = 0.673.
        let coverage = &proud.coverage_95;
        for share in [coverage.along, coverage.up, coverage.out] {
            assert!((share.unwrap() - 0.673).abs() < 0.012, "{coverage:?}");
        }
        assert!((proud.chi_square_mean.unwrap() - 12.0).abs() < 0.2);
    }

    #[test]
    fn each_axis_has_the_coverage_of_its_own_claims() {
        let claim = |error: [f64; 3], half_width: [Option<f64>; 3]| Claim {
            error: error.into(),
            half_width,
            normalised: None,
        };
        let claims = [
            claim([0.5, -2.0, 1.5], [Some(1.0), Some(1.0), None]),
            claim([-0.5, 0.5, 1.5], [Some(1.0), Some(1.0), None]),
            claim([0.5, 3.0, 0.0], [Some(1.0), None, None]),
        ];
        let found = Calibration::of(&claims).coverage_95;
        // Along all three lie inside; up one of the two that claim anything; out nothing is claimed.
        assert_eq!((found.along, found.up, found.out), (Some(1.0), Some(0.5), None));
    }

    #[test]
    fn the_quantile_is_that_of_chi_square() {
        let chi_square = ChiSquared::new(3.0).unwrap();
        assert!((chi_square.inverse_cdf(0.95) - CHI_SQUARE_95).abs() < 1e-6);
    }
}
