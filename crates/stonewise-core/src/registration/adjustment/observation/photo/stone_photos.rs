//! What photos say of one stone, with the poses as they were adjusted.

use super::bias::BiasWeights;
use super::poses::PoseInfluence;
use super::stone_turn::StoneTurn;
use crate::registration::adjustment::candidate::Moving;
use crate::registration::adjustment::observation::normal_equations::NormalEquations;
use crate::registration::adjustment::stone_vector::StoneVector;
use nalgebra::{Matrix2, Matrix3, Matrix3x6, Matrix6, Vector3, Vector6};

/// Relative ridge that makes a direction solvable which no photo shows.
const RIDGE: f64 = 1e-9;
/// Components of a shift: along and up the face.
const SHIFT_COMPONENTS: f64 = 2.0;

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
    /// The turn in the face, where photos show one.
    pub turn: Option<StoneTurn>,
    /// Weights of that bias.
    pub weights: BiasWeights,
    /// How errors of the poses change the displacement; other stones share these errors.
    pub by_poses: PoseInfluence,
}

impl StonePhotos {
    /// Takes a stone's motion to the displacement of the place.
    pub fn lever(place: [f64; 2]) -> Matrix3x6<f64> {
        let mut lever = Matrix3x6::zeros();
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

    /// Components of the bias: along and up the face, and the turn where photos show one.
    pub fn bias_components(&self) -> f64 {
        SHIFT_COMPONENTS + f64::from(u8::from(self.turn.is_some()))
    }

    /// Expected square of the bias over its variance, before it is weighted, given the motion
    /// `expected` from all other observations, with this covariance.
    ///
    /// The photos show displacement, turn and bias, with errors of their own: the bias is estimated from what
    /// they show beyond the motion, and its uncertainty adds to the square.
    pub fn bias_square(
        &self,
        bias_m: f64,
        moving: Moving,
        expected: &StoneVector,
        covariance: &Matrix6<f64>,
    ) -> f64 {
        let lever = Self::lever(self.place);
        let weight = self.weights.of(moving);
        let variance = bias_m * bias_m * self.bias_factor;
        let of_turn = self.turn.as_ref().map_or(0.0, |turn| {
            turn.bias_square(variance.sqrt(), weight, expected, covariance)
        });
        let covariance: Matrix3<f64> = lever * covariance * lever.transpose();
        let Some(inverse) = (Matrix3::identity() + self.information * covariance).try_inverse() else {
            return of_turn;
        };
        let reduced = inverse * self.information;
        let at_expected: Vector3<f64> = lever * expected.unknowns();
        let shown = inverse * (self.vector - self.information * at_expected);
        let prior = Matrix2::identity() * (weight / variance);
        let Some(spread) = (reduced.fixed_view::<2, 2>(0, 0) + prior).try_inverse() else {
            return of_turn;
        };
        let bias = spread * shown.fixed_rows::<2>(0);
        of_turn + (bias.norm_squared() + spread.trace()) / variance
    }

    /// Log likelihood as a quadratic about the motion `origin`. The constant holds what depends on the bias
    /// and its weight.
    pub fn normal_equations(&self, origin: &StoneVector, bias_m: f64, moving: Moving) -> NormalEquations {
        let mut sum = self.of_displacement(origin, bias_m, moving);
        if let Some(turn) = &self.turn {
            sum += turn.normal_equations(origin, self.bias_sd_m(bias_m, moving));
        }
        sum.constant += self.weights.log_density(moving);
        sum
    }

    fn of_displacement(&self, origin: &StoneVector, bias_m: f64, moving: Moving) -> NormalEquations {
        let (information, vector, log_det) = self.with_bias(bias_m, moving);
        let lever = Self::lever(self.place);
        let at_origin: Vector3<f64> = lever * origin.unknowns();
        let pull = vector - information * at_origin;
        let peak = self.displacement().unwrap_or_else(Vector3::zeros);
        let apart = peak - at_origin;
        let vector: Vector6<f64> = lever.transpose() * pull;
        NormalEquations {
            information: lever.transpose() * information * lever,
            vector,
            constant: -0.5 * (log_det + apart.dot(&(information * apart))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix4, Matrix4x6, RowVector3, Vector4};

    fn stone() -> StonePhotos {
        let m = Matrix3::new(2.0, 0.3, 0.1, 0.3, 1.5, -0.2, 0.1, -0.2, 0.1) * 1e6;
        StonePhotos {
            information: m,
            vector: m * Vector3::new(0.003, -0.001, 0.004),
            place: [0.02, -0.03],
            bias_factor: 1.7,
            turn: Some(StoneTurn {
                angle: 0.02,
                variance: 1e-6,
                by_rotation: RowVector3::new(-0.1, 0.2, 1.0),
                radius_m: 0.08,
            }),
            weights: BiasWeights::USUAL,
            by_poses: PoseInfluence::none(),
        }
    }

    /// What the photos show, side by side: how it follows from the motion, its value, its covariance without
    /// the bias, and the covariance of a bias with variance one.
    fn observed(stone: &StonePhotos) -> (Matrix4x6<f64>, Vector4<f64>, Matrix4<f64>, Matrix4<f64>) {
        let turn = stone.turn.as_ref().unwrap();
        let mut lever = Matrix4x6::zeros();
        // A point at r moves by t + w x r.
        let arm = Vector3::new(stone.place[0], stone.place[1], 0.0);
        lever.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        lever.fixed_view_mut::<3, 3>(0, 3).copy_from(&-arm.cross_matrix());
        lever.fixed_view_mut::<1, 3>(3, 3).copy_from(&turn.by_rotation);
        let shown = stone.displacement().unwrap();
        let mut noise = Matrix4::zeros();
        noise
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&stone.information.try_inverse().unwrap());
        noise[(3, 3)] = turn.variance;
        let of_bias = Vector4::new(1.0, 1.0, 0.0, (2.0 / turn.radius_m).powi(2));
        (
            lever,
            Vector4::new(shown.x, shown.y, shown.z, turn.angle),
            noise,
            Matrix4::from_diagonal(&of_bias),
        )
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
        let expected = StoneVector::from(Vector6::from([0.001, 0.0005, 0.003, 0.01, 0.0, 0.016]));
        let sds = Vector6::from([4e-4, 6e-4, 2e-4, 5e-3, 2e-3, 3e-3]);
        let covariance = Matrix6::from_diagonal(&sds.component_mul(&sds));
        // What is shown is the true motion's part plus bias and error, all jointly normal; turn and
        // displacement are correlated only through the offset of the place from the centroid.
        let (lever, shown, noise, of_bias) = observed(&stone);
        let variance = bias_m * bias_m * 1.7;
        let apart = shown - lever * expected.unknowns();
        let together = lever * covariance * lever.transpose();
        let mut by_definition = 0.0;
        for (first, count) in [(0, 3), (3, 1)] {
            let part = |m: &Matrix4<f64>| m.view((first, first), (count, count)).into_owned();
            let of_bias = part(&of_bias) * variance;
            let gain = &of_bias * (part(&together) + &of_bias + part(&noise)).try_inverse().unwrap();
            let mean = &gain * apart.rows(first, count);
            let second = &mean * mean.transpose() + &of_bias - &gain * &of_bias;
            for k in 0..count {
                if of_bias[(k, k)] > 0.0 {
                    by_definition += second[(k, k)] / of_bias[(k, k)];
                }
            }
        }
        let found = stone.bias_square(bias_m, Moving::WithField, &expected, &covariance);
        assert!(
            (found - by_definition).abs() < 1e-6 * by_definition,
            "{found} {by_definition}"
        );
        assert_eq!(stone.bias_components(), 3.0);
    }

    #[test]
    fn equations_are_the_log_density_of_displacement_and_turn() {
        let stone = stone();
        let x = Vector6::from([0.004, -0.002, 0.001, 0.01, -0.02, 0.03]);
        let origin = StoneVector::from_translation(Vector3::new(0.002, 0.001, -0.003));
        let (lever, shown, noise, of_bias) = observed(&stone);
        let density = |x: &Vector6<f64>, bias_m: f64| {
            let covariance = noise + of_bias * (bias_m * bias_m * 1.7);
            let apart = shown - lever * (x + origin.unknowns());
            -0.5 * (covariance.determinant().ln() + apart.dot(&(covariance.try_inverse().unwrap() * apart)))
        };
        let value = |x: &Vector6<f64>, bias_m: f64| {
            let e = stone.normal_equations(&origin, bias_m, Moving::WithField);
            e.constant + e.vector.dot(x) - 0.5 * x.dot(&(e.information * x))
        };
        for (other, bias_m) in [(x, 3e-4), (Vector6::zeros(), 1e-3)] {
            let difference = value(&x, 1e-3) - value(&other, bias_m);
            let expected = density(&x, 1e-3) - density(&other, bias_m);
            assert!(
                (difference - expected).abs() < 1e-5 * expected.abs().max(1.0),
                "{difference} {expected}"
            );
        }
    }
}
