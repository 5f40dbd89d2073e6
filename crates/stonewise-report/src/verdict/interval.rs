//! The 95 % interval of the length of a motion that was measured with an error.
//!
//! t is measured, t = m + error, error ~ N(0, C), and the interval is that of the length |m|. The length of t
//! is too long on average, the more so the smaller the motion, so that |t| +- 1.96 sd would be wrong for
//! small motions.
//!
//! Upper limit: the largest |m| with (t - m)' C^-1 (t - m) <= 1.96^2. Where it falls short of |m|, that
//! ellipsoid lies inside the ball of radius |m| and so on the inner side of the plane that touches the ball
//! at m: u't + 1.96 sqrt(u'Cu) < |m| with u = m / |m|, which happens in at most 2.5 % of the cases, for every
//! m and C.
//!
//! Lower limit: the smallest length r that is not rejected. With d^2(r) = min of (t - m)' C^-1 (t - m) over
//! |m| = r, r is rejected where P(|z + R e| > R + d) < 2.5 %, z standard normal in three dimensions, R = r
//! s_min / s_max^2 with the smallest and the largest standard deviation of C. In coordinates in which C is
//! the unit matrix the ball of radius r is an ellipsoid with curvature radii of R and more, so that a ball of
//! radius R rolls inside it: the probability is an upper bound, and exact for equal standard deviations. At r
//! = 0 it is the chi-square test with three degrees of freedom; for long motions d tends to 1.96, the
//! first-order interval along the motion.
//!
//! Coverage is therefore 95 % at least; `tests` measure it.

use nalgebra::{Matrix3, Vector3};
use statrs::function::erf::erfc;
use std::f64::consts::{PI, SQRT_2};

/// 97.5 % quantile of the normal distribution.
pub(super) const QUANTILE: f64 = 1.959_963_984_540_054;
/// Probability beyond either end of an interval.
const TAIL: f64 = 0.025;
/// Halvings of a bracket: to a relative 1e-12.
const HALVINGS: usize = 60;

/// A measured vector with its covariance; metres, m^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Estimate {
    pub vector: Vector3<f64>,
    pub covariance: Matrix3<f64>,
}

impl Estimate {
    /// Ends of the 95 % interval of the true length, metres; from 0 to infinity where the covariance is not
    /// positive definite.
    pub(crate) fn length_interval(&self) -> [f64; 2] {
        match Axes::of(self) {
            Some(axes) => [axes.lower(), axes.upper()],
            None => [0.0, f64::INFINITY],
        }
    }

    /// Ends of the 95 % interval of a component, metres.
    pub(crate) fn component_interval(&self, axis: usize) -> [f64; 2] {
        let half = QUANTILE * self.covariance[(axis, axis)].max(0.0).sqrt();
        [self.vector[axis] - half, self.vector[axis] + half]
    }

    /// Probability of a vector as unlikely as this one if nothing had moved: chi-square with three degrees of
    /// freedom.
    pub(crate) fn p_value(&self) -> f64 {
        let solved = self.covariance.cholesky().map(|c| c.solve(&self.vector));
        let square = solved.map_or(0.0, |s| self.vector.dot(&s));
        if square.is_finite() {
            beyond(square.max(0.0).sqrt(), 0.0)
        } else {
            1.0
        }
    }

    /// Probability that a single number of this standard deviation is as far from zero by chance: both tails of
    /// the normal distribution.
    pub(super) fn p_value_of(value: f64, sd: f64) -> f64 {
        let p = erfc((value / sd).abs() / SQRT_2);
        if sd > 0.0 && p.is_finite() { p } else { 1.0 }
    }
}

/// P(|z + r e| > distance) of a standard normal z in three dimensions and a unit vector e.
///
/// Source: integral of the noncentral chi density with three degrees of freedom, x / r (phi(x - r) - phi(x +
/// r)).
fn beyond(distance: f64, r: f64) -> f64 {
    let density = |x: f64| (-0.5 * x * x).exp() / (2.0 * PI).sqrt();
    let tail = |x: f64| 0.5 * erfc(x / SQRT_2);
    let slope = if r < 1e-6 {
        2.0 * distance * density(distance)
    } else {
        (density(distance - r) - density(distance + r)) / r
    };
    (tail(distance - r) + tail(distance + r) + slope).clamp(0.0, 1.0)
}

/// The vector along the axes of its error.
struct Axes {
    /// Components.
    along: [f64; 3],
    /// Variances of the components.
    variance: [f64; 3],
}

impl Axes {
    fn of(estimate: &Estimate) -> Option<Self> {
        let all = estimate.vector.iter().chain(estimate.covariance.iter());
        if !all.into_iter().all(|v| v.is_finite()) {
            return None;
        }
        let eigen = estimate.covariance.symmetric_eigen();
        let along = eigen.eigenvectors.transpose() * estimate.vector;
        (eigen.eigenvalues.min() > 0.0).then(|| Self {
            along: along.into(),
            variance: eigen.eigenvalues.into(),
        })
    }

    fn largest(&self) -> f64 {
        self.variance.iter().fold(0.0, |a, v| a.max(*v))
    }

    fn smallest(&self) -> f64 {
        self.variance.iter().fold(f64::INFINITY, |a, v| a.min(*v))
    }

    /// Distance d^2 and length |m| of the point m = a t / (a + C), the nearest of its length: a > 0 inside, a
    /// < -s_max^2 outside.
    fn at(&self, a: f64) -> (f64, f64) {
        let (mut distance, mut length) = (0.0, 0.0);
        for (t, v) in self.along.iter().zip(&self.variance) {
            distance += t * t * v / ((a + v) * (a + v));
            length += (a * t / (a + v)).powi(2);
        }
        (distance, length.sqrt())
    }

    fn upper(&self) -> f64 {
        let largest = self.largest();
        let mut axes = Self { ..*self };
        // A motion right across the longest axis has two farthest points; a trace of motion along it chooses
        // one.
        for (t, v) in axes.along.iter_mut().zip(&self.variance) {
            if *v == largest {
                *t = t.abs().max(1e-9 * largest.sqrt());
            }
        }
        let size = axes.along.iter().map(|t| t * t).sum::<f64>().sqrt();
        // The distance falls from infinity at a = -s_max^2 to 0 far away; it is below the quantile at the
        // upper end of the bracket.
        let reach = size * largest.sqrt() / QUANTILE + largest;
        let (mut low, mut high) = (0.0, reach);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if axes.at(-largest - middle).0 > QUANTILE * QUANTILE {
                low = middle;
            } else {
                high = middle;
            }
        }
        axes.at(-largest - high).1
    }

    fn lower(&self) -> f64 {
        let curvature = self.smallest().sqrt() / self.largest();
        let rejected = |a: f64| {
            let (distance, length) = self.at(a);
            let radius = length * curvature;
            beyond(radius + distance.sqrt(), radius) < TAIL
        };
        if !rejected(0.0) {
            return 0.0;
        }
        // a from 0 (no motion) to infinity (the motion as measured), by a = s_max^2 x / (1 - x).
        let multiplier = |x: f64| self.largest() * x / (1.0 - x);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if middle < 1.0 && rejected(multiplier(middle)) {
                low = middle;
            } else {
                high = middle;
            }
        }
        self.at(multiplier(low)).1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::testing::Normal;

    #[test]
    fn tails_are_those_of_the_chi_square_distribution() {
        // scipy.stats.chi2.sf(x**2, 3) and scipy.stats.ncx2.sf(x**2, 3, r**2).
        for (x, r, expected) in [
            (2.795_483_482_915_108, 0.0, 0.05),
            (1.0, 0.0, 0.801_251_956_900_120_7),
            (2.795_483_482_915_108, 1e-7, 0.05),
        ] {
            assert!((beyond(x, r) - expected).abs() < 1e-9, "{x} {r} {}", beyond(x, r));
        }
        // Simulated, 400,000 draws: five standard deviations of a share are 0.004.
        let mut normal = Normal::new(1);
        for (x, r) in [(3.0, 1.0), (4.0, 3.0), (1.0, 2.0)] {
            let beyond_it = (0..400_000)
                .filter(|_| (normal.vector() + Vector3::x() * r).norm() > x)
                .count();
            assert!((beyond_it as f64 / 4e5 - beyond(x, r)).abs() < 4e-3);
        }
    }

    #[test]
    fn limits_of_a_round_error_are_known() {
        let round = |length: f64| Estimate {
            vector: Vector3::new(0.0, length, 0.0),
            covariance: Matrix3::identity() * 1e-6,
        };
        for length in [0.0, 0.001, 0.005, 0.1] {
            let [low, high] = round(length).length_interval();
            assert!(
                (high - (length + QUANTILE * 1e-3)).abs() < 1e-9,
                "{length} {high}"
            );
            assert!(low <= length && low >= 0.0);
        }
        // Far away the interval is the first-order one.
        let [low, _] = round(0.1).length_interval();
        assert!((low - (0.1 - QUANTILE * 1e-3)).abs() < 3e-5, "{low}");
        assert_eq!(round(0.002).length_interval()[0], 0.0);
    }

    #[test]
    fn a_covariance_that_is_none_gives_no_limits() {
        for covariance in [
            Matrix3::zeros(),
            Matrix3::identity() * f64::NAN,
            -Matrix3::identity(),
        ] {
            let estimate = Estimate {
                vector: Vector3::x(),
                covariance,
            };
            assert_eq!(estimate.length_interval(), [0.0, f64::INFINITY]);
            assert_eq!(estimate.p_value(), 1.0);
        }
    }

    /// Share of draws whose interval holds the length of `motion`, for standard deviations along the axes.
    fn coverage(motion: Vector3<f64>, sd: Vector3<f64>, seed: u64) -> f64 {
        const DRAWS: usize = 6000;
        let covariance = Matrix3::from_diagonal(&sd.component_mul(&sd));
        let mut normal = Normal::new(seed);
        let held = |vector: Vector3<f64>| {
            let [low, high] = Estimate { vector, covariance }.length_interval();
            low <= motion.norm() && motion.norm() <= high
        };
        let draws = (0..DRAWS).map(|_| motion + normal.vector().component_mul(&sd));
        draws.filter(|v| held(*v)).count() as f64 / DRAWS as f64
    }

    #[test]
    fn intervals_hold_95_percent_for_small_and_large_motions() {
        let sds = [
            Vector3::new(1.0, 1.0, 1.0),
            Vector3::new(1.0, 1.0, 4.0),
            Vector3::new(1.0, 5.0, 5.0),
            Vector3::new(0.3, 1.0, 9.0),
        ];
        let directions = [Vector3::x(), Vector3::z(), Vector3::new(1.0, 2.0, 2.0) / 3.0];
        // Three standard deviations of a share of 0.95 in 6,000 draws: 0.0084.
        for (k, sd) in sds.iter().enumerate() {
            for (j, direction) in directions.iter().enumerate() {
                for (i, length) in [0.0, 1.0, 3.0, 8.0, 40.0, 400.0].into_iter().enumerate() {
                    let share = coverage(direction * length, *sd, (100 * k + 10 * j + i) as u64);
                    assert!(
                        share > 0.9416,
                        "{share} at {length} along {direction:?} with {sd:?}"
                    );
                    // Not needlessly wide where the first order holds; with very unequal errors the bound on
                    // the curvature costs more.
                    let most = if sd.max() / sd.min() > 10.0 { 0.99 } else { 0.965 };
                    assert!(
                        length < 400.0 || share < most,
                        "{share} at {length} along {direction:?} with {sd:?}"
                    );
                }
            }
        }
    }
}
