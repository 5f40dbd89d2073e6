//! What photos say of one stone, with the poses as they were adjusted.

use super::poses::PoseInfluence;
use crate::registration::adjustment::observation::normal_equations::NormalEquations;
use crate::registration::adjustment::stone_vector::{StoneVector, Vector9};
use nalgebra::{Matrix3, SMatrix, Vector3};

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

    /// What is known with an appearance bias of this standard deviation, metres, along each axis of the face:
    /// information, and information times displacement.
    pub fn with_bias(&self, bias_m: f64) -> (Matrix3<f64>, Vector3<f64>, f64) {
        let sd = bias_m * self.bias_factor.sqrt();
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

    /// Log likelihood as a quadratic about the motion `origin`. The constant holds what depends on the bias.
    pub fn normal_equations(&self, origin: &StoneVector, bias_m: f64) -> NormalEquations {
        let (information, vector, log_det) = self.with_bias(bias_m);
        let lever = Self::lever(self.place);
        let at_origin: Vector3<f64> = lever * origin.unknowns();
        let pull = vector - information * at_origin;
        let peak = self.displacement().unwrap_or_else(Vector3::zeros);
        let apart = peak - at_origin;
        let vector: Vector9 = lever.transpose() * pull;
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

    fn stone() -> StonePhotos {
        let m = Matrix3::new(2.0, 0.3, 0.1, 0.3, 1.5, -0.2, 0.1, -0.2, 0.1) * 1e6;
        StonePhotos {
            information: m,
            vector: m * Vector3::new(0.003, -0.001, 0.004),
            place: [0.02, -0.03],
            bias_factor: 1.7,
            by_poses: PoseInfluence::none(),
        }
    }

    #[test]
    fn the_bias_adds_to_the_variances_in_the_face() {
        let (stone, bias_m) = (stone(), 8e-4);
        let (information, vector, _) = stone.with_bias(bias_m);
        let variance = bias_m * bias_m * 1.7;
        let expected = stone.information.try_inverse().unwrap()
            + Matrix3::from_diagonal(&Vector3::new(variance, variance, 0.0));
        assert!((information.try_inverse().unwrap() - expected).norm() < 1e-6 * expected.norm());
        let displacement = information.try_inverse().unwrap() * vector;
        assert!((displacement - stone.displacement().unwrap()).norm() < 1e-8);
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
            let e = stone.normal_equations(&origin, bias_m);
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
