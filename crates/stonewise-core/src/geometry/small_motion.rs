//! A small rigid motion, fitted to displacements.

use crate::statistics::upper_median;
use nalgebra::{Matrix3, Matrix6, Point3, SMatrix, Vector3, Vector6};

/// Eigenvalues below this share of the largest belong to motions that the samples do not show.
const LEAST_EIGENVALUE: f64 = 1e-12;
/// Iterations of the reweighting.
const ROUNDS: usize = 10;

/// A displacement with its place and covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplacementSample {
    /// Where, world, metres.
    pub place: Point3<f64>,
    /// Displacement, metres.
    pub displacement: Vector3<f64>,
    /// Its covariance, m^2.
    pub covariance: Matrix3<f64>,
}

/// A rigid motion whose rotation is small: a place p moves by shift + rotation x (p - centre).
#[derive(Clone, Debug, PartialEq)]
pub struct SmallMotion {
    /// Place that shift and rotation refer to, world, metres.
    pub centre: Point3<f64>,
    /// Shift, metres, and rotation vector, radians.
    pub motion: Vector6<f64>,
    /// Covariance of `motion`, m^2, m rad, rad^2.
    pub covariance: Matrix6<f64>,
}

impl SmallMotion {
    /// A translation; its covariance is zero.
    pub fn shift(shift: Vector3<f64>) -> Self {
        let mut motion = Vector6::zeros();
        motion.fixed_rows_mut::<3>(0).copy_from(&shift);
        Self {
            centre: Point3::origin(),
            motion,
            covariance: Matrix6::zeros(),
        }
    }

    /// The rigid motion nearest to the samples by least squares, weighted by their inverse covariances;
    /// samples count as independent.
    ///
    /// Samples whose covariance is not positive definite are left out; `None` without any other. Motions that
    /// the samples do not show, such as a rotation about a line that holds all of them, are zero with
    /// variance zero: they move no sample. Cost: O(samples).
    pub fn fit(samples: &[DisplacementSample]) -> Option<Self> {
        let weighted: Vec<(&DisplacementSample, Matrix3<f64>)> = samples
            .iter()
            .filter_map(|s| Some((s, s.covariance.cholesky()?.inverse())))
            .collect();
        let n = weighted.len() as f64;
        let sum: Vector3<f64> = weighted.iter().map(|(s, _)| s.place.coords).sum();
        let centre = Point3::from(sum / n);
        let square: f64 = weighted
            .iter()
            .map(|(s, _)| (s.place - centre).norm_squared())
            .sum();

        // Rotations in units of a typical arm, so that eigenvalues of shifts and rotations compare.
        let arm_m = (square / n).sqrt().max(f64::MIN_POSITIVE);
        let unit = Matrix6::from_diagonal(&Vector6::new(
            1.0,
            1.0,
            1.0,
            1.0 / arm_m,
            1.0 / arm_m,
            1.0 / arm_m,
        ));
        let (mut information, mut right) = (Matrix6::zeros(), Vector6::zeros());

        for (sample, weight) in &weighted {
            let lever = lever(&(sample.place - centre)) * unit;
            information += lever.transpose() * weight * lever;
            right += lever.transpose() * weight * sample.displacement;
        }

        if weighted.is_empty() || !information.iter().all(|v| v.is_finite()) {
            return None;
        }
        let eigen = information.symmetric_eigen();
        let least = LEAST_EIGENVALUE * eigen.eigenvalues.max();
        let inverse = eigen.eigenvalues.map(|v| if v > least { 1.0 / v } else { 0.0 });
        let covariance =
            eigen.eigenvectors * Matrix6::from_diagonal(&inverse) * eigen.eigenvectors.transpose();

        Some(Self {
            centre,
            motion: unit * covariance * right,
            covariance: unit * covariance * unit,
        })
    }

    /// The rigid motion that most displacements share, by reweighted least squares: those far from it count less (Cauchy
    /// weights, whose scale is twice the median residual). `None` without displacements.
    pub fn common(displacements: impl Iterator<Item = (Point3<f64>, Vector3<f64>)>) -> Option<Self> {
        let mut samples: Vec<DisplacementSample> = displacements
            .map(|(place, displacement)| DisplacementSample {
                place,
                displacement,
                covariance: Matrix3::identity(),
            })
            .collect();
        let mut common = Self::fit(&samples)?;
        for _ in 0..ROUNDS {
            let apart_m = |s: &DisplacementSample| (s.displacement - common.at(&s.place)).norm();
            let mut all: Vec<f64> = samples.iter().map(apart_m).collect();
            let usual_m = upper_median(&mut all)?.max(f64::MIN_POSITIVE);
            for sample in &mut samples {
                let far = apart_m(sample) / (2.0 * usual_m);
                sample.covariance = Matrix3::identity() * (1.0 + far * far);
            }
            common = Self::fit(&samples)?;
        }
        Some(common)
    }

    /// Displacement of a place, metres.
    pub fn at(&self, place: &Point3<f64>) -> Vector3<f64> {
        lever(&(place - self.centre)) * self.motion
    }

    /// Rotation vector, radians.
    pub fn rotation(&self) -> Vector3<f64> {
        self.motion.fixed_rows::<3>(3).into_owned()
    }

    /// Covariance of the displacement of a place, m^2.
    pub fn covariance_at(&self, place: &Point3<f64>) -> Matrix3<f64> {
        let lever = lever(&(place - self.centre));
        lever * self.covariance * lever.transpose()
    }
}

/// The matrix that turns (shift, rotation vector) about a centre into the displacement of the place at `arm`
/// from it.
pub fn lever(arm: &Vector3<f64>) -> SMatrix<f64, 3, 6> {
    let mut lever = SMatrix::<f64, 3, 6>::zeros();
    lever.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    lever.fixed_view_mut::<3, 3>(0, 3).copy_from(&-arm.cross_matrix());
    lever
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn samples(count: usize, of: impl Fn(&Point3<f64>) -> Vector3<f64>) -> Vec<DisplacementSample> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut draw = |scale: f64| Vector3::from_fn(|_, _| rng.random_range(-scale..scale));
        let sample = |_| {
            let place = Point3::new(500.0, 700.0, 30.0) + draw(4.0);
            let root = Matrix3::from_columns(&[draw(1e-3), draw(1e-3), draw(1e-3)]);
            let covariance = root * root.transpose() + Matrix3::identity() * 1e-8;
            DisplacementSample {
                place,
                displacement: of(&place) + draw(1e-3),
                covariance,
            }
        };
        (0..count).map(sample).collect()
    }

    /// Weighted least squares with one dense matrix of all samples.
    fn dense(samples: &[DisplacementSample], centre: &Point3<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let n = 3 * samples.len();
        let (mut a, mut w, mut d) = (DMatrix::zeros(n, 6), DMatrix::zeros(n, n), DVector::zeros(n));
        for (i, s) in samples.iter().enumerate() {
            let arm = s.place - centre;
            for k in 0..3 {
                a[(3 * i + k, k)] = 1.0;
                let mut turn = Vector3::zeros();
                turn[k] = 1.0;
                a.view_mut((3 * i, 3 + k), (3, 1)).copy_from(&turn.cross(&arm));
                d[3 * i + k] = s.displacement[k];
            }
            w.view_mut((3 * i, 3 * i), (3, 3))
                .copy_from(&s.covariance.try_inverse().unwrap());
        }
        let inverse = (a.transpose() * &w * &a).try_inverse().unwrap();
        (&inverse * a.transpose() * w * d, inverse)
    }

    #[test]
    fn it_is_the_weighted_least_squares_solution() {
        let samples = samples(40, |p| Vector3::new(0.01, 0.002 * (p.z - 30.0), 0.0));
        let fitted = SmallMotion::fit(&samples).unwrap();
        let (motion, covariance) = dense(&samples, &fitted.centre);
        assert!((DVector::from_column_slice(fitted.motion.as_slice()) - motion).norm() < 1e-9);
        let expected = covariance.norm();
        assert!(
            (DMatrix::from_column_slice(6, 6, fitted.covariance.as_slice()) - covariance).norm()
                < 1e-6 * expected
        );
        let place = Point3::new(503.0, 699.0, 28.0);
        let turned = fitted.motion.fixed_rows::<3>(3).cross(&(place - fitted.centre));
        assert!((fitted.at(&place) - fitted.motion.fixed_rows::<3>(0) - turned).norm() < 1e-12);
    }

    #[test]
    fn the_common_motion_is_that_of_most_places() {
        let turn = Vector3::new(2e-3, -1e-3, 3e-3);
        let true_motion = |p: &Point3<f64>| Vector3::new(0.3, -0.1, 0.2) + turn.cross(&p.coords);
        let moved = samples(60, true_motion).into_iter().enumerate().map(|(i, s)| {
            let apart = if i % 6 == 0 {
                Vector3::new(0.0, 0.05, 0.08)
            } else {
                Vector3::zeros()
            };
            (s.place, true_motion(&s.place) + apart)
        });
        let found = SmallMotion::common(moved).unwrap();
        assert!((found.rotation() - turn).norm() < 1e-9, "{found:?}");
        assert!((found.at(&found.centre) - true_motion(&found.centre)).norm() < 1e-9);
        assert!(SmallMotion::common(std::iter::empty()).is_none());
        let shift = Vector3::new(0.1, 0.2, 0.3);
        assert_eq!(SmallMotion::shift(shift).at(&found.centre), shift);
    }

    #[test]
    fn what_few_samples_do_not_show_stays_zero() {
        assert!(SmallMotion::fit(&[]).is_none());
        let one = samples(1, |_| Vector3::new(0.0, 0.01, 0.0));
        let fitted = SmallMotion::fit(&one).unwrap();
        assert!((fitted.at(&one[0].place) - one[0].displacement).norm() < 1e-12);
        assert!((fitted.covariance_at(&one[0].place) - one[0].covariance).norm() < 1e-12);
        assert_eq!(fitted.motion.fixed_rows::<3>(3).norm(), 0.0);
    }
}
