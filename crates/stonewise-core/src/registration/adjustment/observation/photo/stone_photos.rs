//! What photos say of one stone, with the poses as they were adjusted.

use super::bias::BiasWeights;
use super::poses::PoseInfluence;
use crate::registration::adjustment::candidate::Moving;
use crate::registration::adjustment::observation::normal_equations::NormalEquations;
use crate::registration::adjustment::stone_vector::{StoneVector, Vector9};
use nalgebra::{Matrix2, Matrix3, SMatrix, Vector3};

/// Relative ridge that makes a direction solvable which no photo shows.
const RIDGE: f64 = 1e-9;

/// The displacement of a place on a stone's face, as its photos show it.
#[derive(Clone, Debug)]
pub(crate) struct StonePhotos {
    /// Information on the displacement in the stone's frame; template and height of the face are eliminated.
    pub information: Matrix3<f64>,
    /// Information times displacement.
    pub vector: Vector3<f64>,
    /// Place on the face, metres from the centroid: along, up.
    pub place: [f64; 2],
    /// Factor on the variance of the stone's appearance bias: faces that seem strained, which stones cannot
    /// be, have more.
    pub bias_factor: f64,
    /// Weights of that bias.
    pub weights: BiasWeights,
    /// How errors of the poses change the displacement; other stones share these errors.
    pub by_poses: PoseInfluence,
}

impl StonePhotos {
    /// Takes a stone's motion to the displacement of the place.
    pub fn lever(place: [f64; 2]) -> SMatrix<f64, 3, 9> {
        let mut lever = SMatrix::<f64, 3, 9>::zeros();
        lever.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        let [u, v] = place;
        lever[(0, 5)] = -v;
        lever[(1, 5)] = u;
        lever[(2, 3)] = v;
        lever[(2, 4)] = -u;
        lever
    }

    /// Standard deviation of the stone's appearance bias along each axis of the face, metres; `bias_m`: scale
    /// of all stones' biases.
    pub fn bias_sd_m(&self, bias_m: f64, moving: Moving) -> f64 {
        bias_m * (self.bias_factor / self.weights.of(moving)).sqrt()
    }

    /// What is known with that bias: information, information times displacement, and log determinant of the
    /// variance that the bias adds.
    pub fn with_bias(&self, bias_m: f64, moving: Moving) -> (Matrix3<f64>, Vector3<f64>, f64) {
        let sd = self.bias_sd_m(bias_m, moving);
        let root = Matrix3::from_diagonal(&Vector3::new(sd, sd, 0.0));
        let inner = Matrix3::identity() + root * self.information * root;
        let Some(factor) = inner.cholesky() else {
            return (Matrix3::zeros(), Vector3::zeros(), 0.0);
        };
        let inverse = root * factor.inverse() * root;
        let information = self.information - self.information * inverse * self.information;
        let vector = self.vector - self.information * (inverse * self.vector);
        (
            0.5 * (information + information.transpose()),
            vector,
            factor.determinant().ln(),
        )
    }

    /// The most likely displacement of the place.
    pub fn displacement(&self) -> Option<Vector3<f64>> {
        let ridge = Matrix3::identity() * (RIDGE * self.information.trace());
        Some((self.information + ridge).cholesky()?.solve(&self.vector))
    }

    /// Expected square of the bias over its variance, before it is weighted, for a displacement that all else
    /// makes `expected`, with this covariance.
    ///
    /// The photos show displacement and bias, with errors of their own: the bias is estimated from what they
    /// show beyond the displacement, and its uncertainty adds to the square.
    pub fn bias_square(
        &self,
        bias_m: f64,
        moving: Moving,
        expected: &Vector3<f64>,
        covariance: &Matrix3<f64>,
    ) -> f64 {
        let Some(inverse) = (Matrix3::identity() + self.information * covariance).try_inverse() else {
            return 0.0;
        };
        let reduced = inverse * self.information;
        let shown = inverse * (self.vector - self.information * expected);
        let variance = bias_m * bias_m * self.bias_factor;
        let prior = Matrix2::identity() * (self.weights.of(moving) / variance);
        let Some(spread) = (reduced.fixed_view::<2, 2>(0, 0) + prior).try_inverse() else {
            return 0.0;
        };
        let bias = spread * shown.fixed_rows::<2>(0);
        (bias.norm_squared() + spread.trace()) / variance
    }

    /// Log likelihood as a quadratic about the motion `origin`. The constant holds what depends on the bias
    /// and its weight.
    pub fn normal_equations(&self, origin: &StoneVector, bias_m: f64, moving: Moving) -> NormalEquations {
        let (information, vector, log_det) = self.with_bias(bias_m, moving);
        let lever = Self::lever(self.place);
        let at_origin: Vector3<f64> = lever * origin.unknowns();
        let pull = vector - information * at_origin;
        let peak = self.displacement().unwrap_or_else(Vector3::zeros);
        let apart = peak - at_origin;
        let vector: Vector9 = lever.transpose() * pull;
        NormalEquations {
            information: lever.transpose() * information * lever,
            vector,
            constant: self.weights.log_density(moving) - 0.5 * (log_det + apart.dot(&(information * apart))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stone() -> StonePhotos {
        let m = Matrix3::new(2.0, 0.3, 0.1, 0.3, 1.5, -0.2, 0.1, -0.2, 0.1) * 1e6;
        StonePhotos {
            information: m,
            vector: m * Vector3::new(0.003, -0.001, 0.004),
            place: [0.02, -0.03],
            bias_factor: 1.7,
            weights: BiasWeights::USUAL,
            by_poses: PoseInfluence::none(),
        }
    }

    #[test]
    fn the_bias_adds_to_the_variances_in_the_face() {
        let (stone, bias_m) = (stone(), 8e-4);
        let (information, vector, _) = stone.with_bias(bias_m, Moving::WithField);
        let variance = bias_m * bias_m * 1.7;
        let expected = stone.information.try_inverse().unwrap()
            + Matrix3::from_diagonal(&Vector3::new(variance, variance, 0.0));
        assert!((information.try_inverse().unwrap() - expected).norm() < 1e-6 * expected.norm());
        let displacement = information.try_inverse().unwrap() * vector;
        assert!((displacement - stone.displacement().unwrap()).norm() < 1e-8);
    }

    #[test]
    fn the_squared_bias_is_its_expectation_in_the_joint_law() {
        let (stone, bias_m) = (stone(), 8e-4);
        let expected = Vector3::new(0.001, 0.0005, 0.003);
        let root = Matrix3::new(4e-4, 0.0, 0.0, 1e-4, 6e-4, 0.0, 2e-4, -1e-4, 5e-4);
        let covariance = root * root.transpose();
        // The shown displacement is the true one plus bias and error: all three jointly normal.
        let variance = bias_m * bias_m * 1.7;
        let of_bias = Matrix3::from_diagonal(&Vector3::new(variance, variance, 0.0));
        let of_shown = covariance + of_bias + stone.information.try_inverse().unwrap();
        let gain = of_bias * of_shown.try_inverse().unwrap();
        let mean = gain * (stone.displacement().unwrap() - expected);
        let spread = of_bias - gain * of_bias;
        let by_definition = (mean.norm_squared() + spread.trace()) / variance;
        let found = stone.bias_square(bias_m, Moving::WithField, &expected, &covariance);
        assert!(
            (found - by_definition).abs() < 1e-6 * by_definition,
            "{found} {by_definition}"
        );
    }

    #[test]
    fn equations_are_the_log_density_of_the_displacement() {
        let stone = stone();
        let x = Vector9::from([0.004, -0.002, 0.001, 0.01, -0.02, 0.03, 0.0, 0.0, 0.0]);
        let origin = StoneVector::from_translation(Vector3::new(0.002, 0.001, -0.003));
        let density = |bias_m: f64| {
            let variance = bias_m * bias_m * 1.7;
            let covariance = stone.information.try_inverse().unwrap()
                + Matrix3::from_diagonal(&Vector3::new(variance, variance, 0.0));
            let motion: Vector9 = x + origin.unknowns();
            let turn = Vector3::new(motion[3], motion[4], motion[5]);
            let place = Vector3::new(0.02, -0.03, 0.0);
            let apart = motion.fixed_rows::<3>(0) + turn.cross(&place) - Vector3::new(0.003, -0.001, 0.004);
            -0.5 * (covariance.determinant().ln() + apart.dot(&(covariance.try_inverse().unwrap() * apart)))
        };
        let value = |bias_m: f64| {
            let e = stone.normal_equations(&origin, bias_m, Moving::WithField);
            e.constant + e.vector.dot(&x) - 0.5 * x.dot(&(e.information * x))
        };
        let difference = value(1e-3) - value(3e-4);
        let expected = density(1e-3) - density(3e-4);
        assert!(
            (difference - expected).abs() < 1e-5 * expected.abs().max(1.0),
            "{difference} {expected}"
        );
    }
}
