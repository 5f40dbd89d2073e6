//! Elimination of each stone's own motion: what its observations say of the field alone.

use super::problem::{FieldProblem, FieldStone};
use crate::registration::adjustment::observation::NormalEquations;
use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;

/// Normal equations of the field's motion at a stone, in its frame, the stone's own motion integrated out.
pub(crate) struct Eliminated {
    pub information: Matrix6<f64>,
    pub vector: Vector6<f64>,
    /// Log of the integral at a field motion of zero.
    pub log_evidence: f64,
}

/// Mixture components of less weight than this are left out: they add nothing to double precision results.
const NEGLIGIBLE: f64 = 1e-6;

/// Eliminates each stone's own motion; a stone's two mixture components are weighted by their probabilities.
///
/// `own_variances`: of the own motions of stones that move with the field, and of loose ones.
pub(crate) fn eliminate_own_motions(
    problem: &FieldProblem,
    own_variances: &[[f64; 6]; 2],
) -> Vec<Eliminated> {
    let of_stone = |stone: &FieldStone| {
        let mut sum = Eliminated {
            information: Matrix6::zeros(),
            vector: Vector6::zeros(),
            log_evidence: 0.0,
        };
        let shares = [stone.p_with_field, 1.0 - stone.p_with_field];
        for (own, share) in own_variances.iter().zip(shares) {
            if share > NEGLIGIBLE {
                let part = eliminate(stone.equations, own);
                sum.information += part.information * share;
                sum.vector += part.vector * share;
                sum.log_evidence += part.log_evidence * share;
            }
        }
        sum
    };
    problem.stones.par_iter().map(of_stone).collect()
}

/// With D the standard deviations of the own motion: H - H D (I + D H D)^-1 D H, and so for the vector.
fn eliminate(equations: &NormalEquations, own: &[f64; 6]) -> Eliminated {
    let root = Vector6::from_fn(|k, _| own[k].sqrt());
    let (h, b) = (&equations.information, &equations.vector);
    let scaled = Matrix6::from_fn(|r, c| root[r] * h[(r, c)] * root[c]) + Matrix6::identity();
    let Some(factor) = scaled.cholesky() else {
        return Eliminated {
            information: Matrix6::zeros(),
            vector: Vector6::zeros(),
            log_evidence: 0.0,
        };
    };
    let rb = root.component_mul(b);
    let rh = Matrix6::from_fn(|r, c| root[r] * h[(r, c)]);
    let solved = factor.solve(&rb);
    let m = h - rh.transpose() * factor.solve(&rh);
    let log_det: f64 = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    Eliminated {
        information: 0.5 * (m + m.transpose()),
        vector: b - rh.transpose() * solved,
        log_evidence: 0.5 * (rb.dot(&solved) - log_det),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn eliminating_is_adding_the_own_variance_to_that_of_the_observation() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let m = Matrix6::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let information = m * m.transpose() * 1e4 + Matrix6::identity() * 1e2;
        let optimum = Vector6::from_fn(|_, _| rng.random_range(-0.1..0.1));
        let own: [f64; 6] = std::array::from_fn(|k| 1e-5 * (k + 1) as f64);
        let equations = NormalEquations {
            information,
            vector: information * optimum,
            constant: 0.0,
        };
        let found = eliminate(&equations, &own);
        let own = Matrix6::from_diagonal(&Vector6::from(own));
        let expected = (information.try_inverse().unwrap() + own).try_inverse().unwrap();
        assert!((found.information - expected).norm() < 1e-9 * expected.norm());
        assert!((found.vector - expected * optimum).norm() < 1e-9 * found.vector.norm());
        // The integral of a Gaussian: |I + H D|^-1/2 exp(b' (H + D^-1)^-1 b / 2).
        let b = equations.vector;
        let inner = (information + own.try_inverse().unwrap()).try_inverse().unwrap();
        let log_det = (Matrix6::identity() + information * own).determinant().ln();
        let log_integral = 0.5 * (b.dot(&(inner * b)) - log_det);
        assert!((found.log_evidence - log_integral).abs() < 1e-7 * log_integral.abs());
    }
}
