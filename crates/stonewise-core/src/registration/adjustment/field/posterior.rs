//! A stone's motion from the field around it and its own observations.

use crate::registration::adjustment::observation::NormalEquations;
use crate::registration::adjustment::stone_vector::StoneVector;
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// A stone's motion as all other stones predict it, in its frame: translation and rotation.
#[derive(Clone, Debug)]
pub(crate) struct Prediction {
    pub mean: Vector6<f64>,
    pub covariance: Matrix6<f64>,
}

impl Prediction {
    /// The prediction for a stone that moved by `by_m` metres more, in its frame.
    pub fn moved(&self, by_m: &Vector3<f64>) -> Self {
        let mut moved = self.clone();
        let mut translation = moved.mean.fixed_rows_mut::<3>(0);
        translation += by_m;
        moved
    }
}

/// A stone's posterior in its frame.
#[derive(Clone, Debug)]
pub(crate) struct Posterior {
    pub mean: StoneVector,
    pub covariance: Matrix6<f64>,
    /// Log probability of the stone's observations.
    pub log_evidence: f64,
    /// Effective degrees of freedom: how many unknowns the stone's own observations determine, 0 to 6.
    pub effective_freedom: f64,
}

/// Relative and absolute ridge on the own variances (m^2, rad^2): keeps the spread positive definite
/// to double precision where the field's covariance has rounding errors, far below any variance that counts.
const RIDGE: [f64; 2] = [1e-9, 1e-18];

/// Posterior of a stone given the prediction and its own observations, for own variances `own`.
pub(crate) fn posterior(equations: &NormalEquations, prediction: &Prediction, own: &[f64; 6]) -> Posterior {
    let mean = prediction.mean;
    let root = root_of_spread(prediction, own);
    let gain = root.transpose() * equations.information * root;
    let surprise = root.transpose() * (equations.vector - equations.information * mean);
    let eigen = (0.5 * (gain + gain.transpose())).symmetric_eigen();
    let mut step = Vector6::zeros();
    let mut covariance = Matrix6::zeros();
    let at_mean = equations.vector.dot(&mean) - 0.5 * mean.dot(&(equations.information * mean));
    let mut log_evidence = equations.constant + at_mean;

    for k in 0..6 {
        let g = eigen.eigenvalues[k].max(0.0);
        let direction = eigen.eigenvectors.column(k).into_owned();
        let s = direction.dot(&surprise);
        step += direction * (s / (1.0 + g));
        covariance += direction * direction.transpose() / (1.0 + g);
        log_evidence += 0.5 * (s * s / (1.0 + g) - (1.0 + g).ln());
    }

    let explained = eigen.eigenvalues.iter().map(|g| g.max(0.0) / (1.0 + g.max(0.0)));
    Posterior {
        mean: (mean + root * step).into(),
        covariance: root * covariance * root.transpose(),
        log_evidence,
        effective_freedom: explained.sum(),
    }
}

/// Covariance of the stone's translation against the prediction (posterior mean less predicted mean), as an
/// estimate of what the stone did beside the field.
///
/// Prediction and posterior are correlated: with C the covariance of the posterior, P that of the motion
/// before the stone's own observations and S that of the prediction, the error of their difference has
/// C + S - C P^-1 S - S P^-1 C. `shared`: variances of errors of the observations that their equations leave
/// out; of these the difference takes up I - C P^-1. `posterior`: of the same `prediction` and `own`.
pub(crate) fn covariance_against(
    posterior: &Posterior,
    prediction: &Prediction,
    own: &[f64; 6],
    shared: &[f64; 6],
) -> Matrix3<f64> {
    let root = root_of_spread(prediction, own);
    let of_prior = root
        .solve_lower_triangular(&posterior.covariance)
        .and_then(|half| root.transpose().solve_upper_triangular(&half))
        .unwrap_or_else(Matrix6::zeros)
        .transpose();
    let of_prediction = prediction.covariance;
    let cross = of_prior * of_prediction;
    let gain = Matrix6::identity() - of_prior;
    let left_out = gain * Matrix6::from_diagonal(&Vector6::from(*shared)) * gain.transpose();
    let whole = posterior.covariance + of_prediction - cross - cross.transpose() + left_out;
    whole.fixed_view::<3, 3>(0, 0).into_owned()
}

/// Square root of the covariance of the stone's motion before its own observations: prediction and own
/// motion.
fn root_of_spread(prediction: &Prediction, own: &[f64; 6]) -> Matrix6<f64> {
    let mut spread = prediction.covariance;
    for k in 0..6 {
        spread[(k, k)] += own[k] * (1.0 + RIDGE[0]) + RIDGE[1];
    }
    spread.cholesky().map_or_else(
        || Matrix6::from_diagonal(&spread.diagonal().map(|v| v.max(0.0).sqrt())),
        |c| c.l(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Random information and prediction, about a millimetre each.
    fn random(rng: &mut ChaCha8Rng) -> (Matrix6<f64>, Prediction) {
        let m = Matrix6::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let p = Matrix6::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let prediction = Prediction {
            mean: Vector6::from_fn(|_, _| rng.random_range(-0.01..0.01)),
            covariance: p * p.transpose() * 1e-6 + Matrix6::identity() * 1e-6,
        };
        (m * m.transpose() * 1e6 + Matrix6::identity() * 1e6, prediction)
    }

    #[test]
    fn the_error_against_the_prediction_is_that_of_its_independent_parts() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let (information, prediction) = random(&mut rng);
        let shared = [1e-7, 2e-7, 3e-7, 1e-6, 1e-6, 1e-6];
        for own in [1e-12, 1e-6, 1e-2] {
            let own = [own; 6];
            let equations = NormalEquations {
                information,
                vector: information * Vector6::from_element(1e-3),
                constant: 0.0,
            };
            let posterior = posterior(&equations, &prediction, &own);
            // The difference takes up the share G = C H of the prediction's error, of the own motion and of
            // the observations' error; the own motion is what it should show.
            let gain = posterior.covariance * information;
            let missed = gain - Matrix6::identity();
            let of_observations =
                information.try_inverse().unwrap() + Matrix6::from_diagonal(&Vector6::from(shared));
            let expected = missed * Matrix6::from_diagonal(&Vector6::from(own)) * missed.transpose()
                + gain * (prediction.covariance + of_observations) * gain.transpose();
            let expected = expected.fixed_view::<3, 3>(0, 0).into_owned();
            let found = covariance_against(&posterior, &prediction, &own, &shared);
            assert!(
                (found - expected).norm() < 1e-6 * expected.norm(),
                "{found} {expected}"
            );
        }
    }

    #[test]
    fn prediction_and_observations_join_as_two_gaussians_do() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let (information, prediction) = random(&mut rng);
        let equations = NormalEquations {
            information,
            vector: information * Vector6::from_fn(|_, _| rng.random_range(-0.01..0.01)),
            constant: 2.0,
        };
        let own = [1e-6, 1e-6, 4e-6, 1e-5, 1e-5, 1e-5];
        let found = posterior(&equations, &prediction, &own);
        let before = Matrix6::from_diagonal(&Vector6::from(own)) + prediction.covariance;
        let mean = prediction.mean;
        let precision = before.try_inverse().unwrap();
        let covariance = (information + precision).try_inverse().unwrap();
        let expected = covariance * (equations.vector + precision * mean);
        assert!((found.mean.unknowns() - expected).norm() < 1e-7 * expected.norm());
        assert!((found.covariance - covariance).norm() < 1e-6 * covariance.norm());
        // The trace of the resolution matrix.
        let resolution = (covariance * information).trace();
        assert!(
            (found.effective_freedom - resolution).abs() < 1e-6,
            "{resolution}"
        );
        let b = equations.vector;
        let at_mean = b.dot(&mean) - 0.5 * mean.dot(&(information * mean));
        let pull = b - information * mean;
        let log_det = (Matrix6::identity() + information * before).determinant().ln();
        let log_evidence = 2.0 + at_mean + 0.5 * (pull.dot(&(covariance * pull)) - log_det);
        assert!((found.log_evidence - log_evidence).abs() < 1e-6 * log_evidence.abs());
    }
}
