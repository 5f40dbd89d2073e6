//! A stone's motion from the field around it and its own observations.

use crate::registration::adjustment::observation::NormalEquations;
use crate::registration::adjustment::stone_vector::{Matrix9, StoneVector, Vector9};
use nalgebra::{Matrix6, Vector6};

/// A stone's motion as all other stones predict it, in its frame: translation and rotation.
#[derive(Clone, Debug)]
pub(crate) struct Prediction {
    pub mean: Vector6<f64>,
    pub covariance: Matrix6<f64>,
}

/// A stone's posterior in its frame.
#[derive(Clone, Debug)]
pub(crate) struct Posterior {
    pub mean: StoneVector,
    pub covariance: Matrix9,
    /// Log probability of the stone's observations.
    pub log_evidence: f64,
    /// Squared standardised difference between the stone's observations and the prediction, and its degrees
    /// of freedom.
    pub misfit: (f64, usize),
    /// Effective degrees of freedom: how many unknowns the stone's own observations determine, 0 to 9.
    pub effective_freedom: f64,
}

/// Share of a direction's prior variance that the observations must explain for it to enter the misfit.
/// Directions that they show less (bending of small stones, rotation in a smooth face) would only add degrees
/// of freedom and hide a misfit.
const INFORMED: f64 = 0.1;
/// Relative and absolute ridge on the own variances (m^2, rad^2, 1/m^2): keeps the spread positive definite
/// to double precision where the field's covariance has rounding errors, far below any variance that counts.
const RIDGE: [f64; 2] = [1e-9, 1e-18];

/// Posterior of a stone given the prediction and its own observations, for own variances `own`.
pub(crate) fn posterior(equations: &NormalEquations, prediction: &Prediction, own: &[f64; 9]) -> Posterior {
    let mut mean = Vector9::zeros();
    mean.fixed_rows_mut::<6>(0).copy_from(&prediction.mean);
    let root = root_of_spread(prediction, own);
    let gain = root.transpose() * equations.information * root;
    let surprise = root.transpose() * (equations.vector - equations.information * mean);
    let eigen = (0.5 * (gain + gain.transpose())).symmetric_eigen();
    let mut step = Vector9::zeros();
    let mut covariance = Matrix9::zeros();
    let at_mean = equations.vector.dot(&mean) - 0.5 * mean.dot(&(equations.information * mean));
    let (mut log_evidence, mut misfit, mut freedom) = (equations.constant + at_mean, 0.0, 0);
    for k in 0..9 {
        let g = eigen.eigenvalues[k].max(0.0);
        let direction = eigen.eigenvectors.column(k).into_owned();
        let s = direction.dot(&surprise);
        step += direction * (s / (1.0 + g));
        covariance += direction * direction.transpose() / (1.0 + g);
        log_evidence += 0.5 * (s * s / (1.0 + g) - (1.0 + g).ln());
        if g > INFORMED {
            misfit += s * s / (g * (1.0 + g));
            freedom += 1;
        }
    }
    let explained = eigen.eigenvalues.iter().map(|g| g.max(0.0) / (1.0 + g.max(0.0)));
    Posterior {
        mean: (mean + root * step).into(),
        covariance: root * covariance * root.transpose(),
        log_evidence,
        misfit: (misfit, freedom),
        effective_freedom: explained.sum(),
    }
}

/// Square root of the covariance of the stone's motion before its own observations: prediction and own
/// motion.
fn root_of_spread(prediction: &Prediction, own: &[f64; 9]) -> Matrix9 {
    let mut spread = Matrix9::zeros();
    spread
        .fixed_view_mut::<6, 6>(0, 0)
        .copy_from(&prediction.covariance);
    for k in 0..9 {
        spread[(k, k)] += own[k] * (1.0 + RIDGE[0]) + RIDGE[1];
    }
    spread.cholesky().map_or_else(
        || Matrix9::from_diagonal(&spread.diagonal().map(|v| v.max(0.0).sqrt())),
        |c| c.l(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn prediction_and_observations_join_as_two_gaussians_do() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let m = Matrix9::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let information = m * m.transpose() * 1e6 + Matrix9::identity() * 1e6;
        let p = Matrix6::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let prediction = Prediction {
            mean: Vector6::from_fn(|_, _| rng.random_range(-0.01..0.01)),
            covariance: p * p.transpose() * 1e-6 + Matrix6::identity() * 1e-6,
        };
        let equations = NormalEquations {
            information,
            vector: information * Vector9::from_fn(|_, _| rng.random_range(-0.01..0.01)),
            constant: 2.0,
        };
        let own = [1e-6, 1e-6, 4e-6, 1e-5, 1e-5, 1e-5, 1e-4, 1e-4, 1e-4];
        let found = posterior(&equations, &prediction, &own);
        let mut before = Matrix9::from_diagonal(&Vector9::from(own));
        let mut part = before.fixed_view_mut::<6, 6>(0, 0);
        part += prediction.covariance;
        let mut mean = Vector9::zeros();
        mean.fixed_rows_mut::<6>(0).copy_from(&prediction.mean);
        let precision = before.try_inverse().unwrap();
        let covariance = (information + precision).try_inverse().unwrap();
        let expected = covariance * (equations.vector + precision * mean);
        assert!((found.mean.unknowns() - expected).norm() < 1e-7 * expected.norm());
        assert!((found.covariance - covariance).norm() < 1e-6 * covariance.norm());
        // The trace of the resolution matrix, and the chi-square of the difference with its covariance.
        let resolution = (covariance * information).trace();
        assert!(
            (found.effective_freedom - resolution).abs() < 1e-6,
            "{resolution}"
        );
        let observed = information.try_inverse().unwrap();
        let difference = observed * equations.vector - mean;
        let chi_square = difference.dot(&((observed + before).try_inverse().unwrap() * difference));
        assert_eq!(found.misfit.1, 9);
        assert!((found.misfit.0 / chi_square - 1.0).abs() < 1e-6, "{chi_square}");
        let b = equations.vector;
        let at_mean = b.dot(&mean) - 0.5 * mean.dot(&(information * mean));
        let pull = b - information * mean;
        let log_det = (Matrix9::identity() + information * before).determinant().ln();
        let log_evidence = 2.0 + at_mean + 0.5 * (pull.dot(&(covariance * pull)) - log_det);
        assert!((found.log_evidence - log_evidence).abs() < 1e-6 * log_evidence.abs());
    }
}
