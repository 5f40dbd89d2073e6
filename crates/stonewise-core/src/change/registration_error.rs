//! Detection limits of M3C2 under a registration error that differs from place to place.

use super::m3c2::variances_of_means;
use super::{ChangeField, ChangePoint};
use crate::statistics::{UPPER_95, student_95};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

impl ChangeField {
    /// Replaces the detection limits by those under a registration error of each core point: LoD95 = t(nu) sqrt(s1^2 /
    /// n1 + s2^2 / n2) + 1.96 reg. Student's quantile t takes the place of 1.96 because the spreads come from few
    /// points; nu after Welch (1947).
    ///
    /// `error_m`: standard deviation of the error along the normal, metres. Points without a limit stay
    /// without one. Source: Lague, Brodu & Leroux (2013), equation 1.
    #[must_use]
    pub fn with_registration_errors(mut self, error_m: impl Fn(&ChangePoint) -> f64 + Sync) -> Self {
        let z95 = Normal::standard().inverse_cdf(UPPER_95);
        self.points.par_iter_mut().for_each(|point| {
            let of_means = variances_of_means(point.spread_m, point.counts);
            if let (Some(_), Some(of_means)) = (point.detection_limit_m, of_means) {
                let quantile = student_95(freedom(of_means, point.counts.map(f64::from)), z95);
                let random = quantile * (of_means[0] + of_means[1]).sqrt();
                point.detection_limit_m = Some(random + z95 * error_m(point));
            }
        });
        self
    }
}

/// Degrees of freedom of a difference of means with these variances.
fn freedom(of_means: [f64; 2], counts: [f64; 2]) -> f64 {
    let sum = of_means[0] + of_means[1];
    let of_each = |k: usize| of_means[k] * of_means[k] / (counts[k] - 1.0).max(1.0);
    match sum > 0.0 {
        true => sum * sum / (of_each(0) + of_each(1)),
        false => f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn point(spread_m: [f64; 2], counts: [u32; 2]) -> ChangePoint {
        ChangePoint {
            position: Point3::new(1.0, 2.0, 3.0),
            normal: Vector3::x(),
            distance_m: Some(0.0),
            detection_limit_m: Some(1.0),
            spread_m: spread_m.map(Some),
            counts,
        }
    }

    #[test]
    fn few_points_hold_their_share_where_the_normal_quantile_does_not() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut draw = |n: u32, sd: f64| {
            let law = Normal::standard();
            let values: Vec<f64> = (0..n)
                .map(|_| sd * law.inverse_cdf(rng.random_range(1e-12..1.0)))
                .collect();
            let mean = values.iter().sum::<f64>() / f64::from(n);
            let square: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
            (mean, (square / f64::from(n - 1)).sqrt())
        };
        let (mut outside, mut outside_normal) = (0, 0);
        let trials = 20_000;
        for _ in 0..trials {
            let ((m1, s1), (m2, s2)) = (draw(5, 0.01), draw(7, 0.02));
            let field = ChangeField {
                points: vec![point([s1, s2], [5, 7])],
            };
            let limit = field.with_registration_errors(|_| 0.0).points[0]
                .detection_limit_m
                .unwrap();
            let normal = 1.96 * (s1 * s1 / 5.0 + s2 * s2 / 7.0).sqrt();
            outside += usize::from((m2 - m1).abs() > limit);
            outside_normal += usize::from((m2 - m1).abs() > normal);
        }
        let [share, share_normal] = [outside, outside_normal].map(|n| n as f64 / f64::from(trials));
        assert!((0.043..0.057).contains(&share), "{share}");
        assert!(share_normal > 0.075, "{share_normal}");
    }

    #[test]
    fn the_error_counts_at_each_place_and_no_limit_stays_none() {
        let mut without = point([0.0, 0.0], [9, 9]);
        without.detection_limit_m = None;
        let mut far = point([0.0, 0.0], [9, 9]);
        far.position.x = 5.0;
        let field = ChangeField {
            points: vec![point([0.0, 0.0], [9, 9]), far, without],
        };
        let found = field.with_registration_errors(|p| 1e-3 * p.position.x);
        let limits: Vec<Option<f64>> = found.points.iter().map(|p| p.detection_limit_m).collect();
        assert!((limits[0].unwrap() - 1.96e-3).abs() < 1e-6);
        assert!((limits[1].unwrap() - 9.8e-3).abs() < 1e-6);
        assert_eq!(limits[2], None);

        // Student's quantile belongs to the spreads alone: 2.119905 for the 16 degrees of freedom of two means of
        // nine points (tables of quantiles at 97.5 %).
        let spread = ChangeField {
            points: vec![point([0.01; 2], [9; 2])],
        };
        let found = spread.with_registration_errors(|_| 0.02).points[0].detection_limit_m;
        let expected = 2.119_905 * (2.0 * 0.01f64.powi(2) / 9.0).sqrt() + 1.959_964 * 0.02;
        assert!((found.unwrap() - expected).abs() < 1e-6, "{found:?} {expected}");
    }
}
