//! The probability of each stone to move with the field.

use super::posterior::{Prediction, posterior};
use super::problem::FieldProblem;
use super::solve::Field;
use crate::registration::adjustment::observation::NormalEquations;
use rayon::prelude::*;

/// Probability of each stone to move with the field, given all others.
///
/// `on_own`: equations at the stone's own optimum, where that is followed; a loose stone's likelihood is
/// taken there. `shared`: variances of errors that look like a stone's own motion; `shares`: probability of each
/// stone to leave the field, beforehand.
pub(crate) fn probabilities_with_field(
    problem: &FieldProblem,
    on_own: &[Option<&NormalEquations>],
    field: &Field,
    shared: &[f64; 6],
    shares: &[f64],
) -> Vec<f64> {
    let own: [[f64; 6]; 2] = problem
        .own_variances()
        .map(|own| std::array::from_fn(|k| own[k] + shared[k]));
    (0..problem.stones.len())
        .into_par_iter()
        .map(|i| {
            let equations = problem.stones[i].equations;
            let both = [equations, on_own[i].unwrap_or(equations)];
            1.0 / (1.0 + log_odds_of_loose(both, &field.from_others[i], &own, shares[i]).exp())
        })
        .collect()
}

/// Log odds of a stone being loose against moving with the field, from its equations at the field's motion
/// and at its own.
///
/// `own`: variances of what it does beside `prediction` in either case; `share`: expected share of loose
/// stones.
pub(crate) fn log_odds_of_loose(
    equations: [&NormalEquations; 2],
    prediction: &Prediction,
    own: &[[f64; 6]; 2],
    share: f64,
) -> f64 {
    let [tied, loose] = [0, 1].map(|k| posterior(equations[k], prediction, &own[k]).log_evidence);
    (loose + share.ln()) - (tied + (1.0 - share).ln())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::field::solve::solve;
    use crate::registration::adjustment::field::testing::{LOOSE, SmallWall};
    use crate::registration::adjustment::stone_vector::StoneVector;
    use nalgebra::{Matrix6, Vector3, Vector6};

    #[test]
    fn the_probability_is_bayes_rule_between_two_gaussians() {
        let mut wall = SmallWall::new(5, 4, 1);
        let weights = Vector6::from([1e7, 1e7, 1e7, 1e5, 1e5, 1e5]);
        for (k, equations) in wall.equations.iter_mut().enumerate() {
            let own = if k == 7 {
                Vector3::new(0.0, 0.0, 0.006)
            } else {
                Vector3::zeros()
            };
            equations.information = Matrix6::from_diagonal(&weights);
            equations.vector = equations.information * StoneVector::from_translation(own).unknowns();
        }
        let problem = wall.problem(1.0);
        let field = solve(&problem).unwrap();
        let found = probabilities_with_field(
            &problem,
            &[None; 20],
            &field,
            &[0.0; 6],
            &[problem.loose.share; 20],
        );
        for (i, (p, prediction)) in found.iter().zip(&field.from_others).enumerate() {
            let density = |own: [f64; 6]| {
                let noise = Matrix6::from_diagonal(&(Vector6::from(own) + weights.map(|w| 1.0 / w)));
                let covariance = noise + prediction.covariance;
                let apart = problem.stones[i].equations.vector.component_div(&weights) - prediction.mean;
                let factor = covariance.cholesky().unwrap();
                let log_det = 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
                -0.5 * (apart.dot(&factor.solve(&apart)) + log_det)
            };
            let [tied, loose] = problem.own_variances().map(density);
            let odds = (loose - tied).exp() * LOOSE.share / (1.0 - LOOSE.share);
            assert!((p - 1.0 / (1.0 + odds)).abs() < 1e-6, "{i}: {p} {odds}");
        }
        assert!(found[7] < 0.05 && found[0] > 0.9, "{found:?}");
    }
}
