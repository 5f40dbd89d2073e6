//! The joint adjustment of the field: a smooth motion over the wall that all stones observe.
//!
//! A stone's motion is the field's displacement and rotation at its centroid plus a motion of its own, small
//! for nearly all stones and large for loose ones (a mixture).

use super::eliminate::{Eliminated, eliminate_own_motions};
use super::field_vector::{FieldVector, Matrix9, StoneFromField, Vector9, stone_from_field};
use super::posterior::Prediction;
use super::prior::prior;
use super::problem::FieldProblem;
use crate::linalg::{BlockFactor, BlockMatrix, SelectedInverse};
use nalgebra::{Matrix3, Matrix6, SMatrix, Vector6};
use rayon::prelude::*;

/// The adjusted field.
pub(crate) struct Field {
    /// Field unknowns, per stone.
    pub state: Vec<FieldVector>,
    /// Prediction of each stone's motion without its own observations, in its frame.
    pub from_others: Vec<Prediction>,
    /// Covariance of the field's mean over all stones, world, m^2.
    pub mean_covariance: Matrix3<f64>,
    /// Covariances of the unknowns of each stone and of neighbours.
    pub inverse: SelectedInverse<9>,
}

/// The normal equations of the field, factored.
pub(crate) struct Normal<'a> {
    pub factor: BlockFactor<'a, 9>,
    pub state: Vec<Vector9>,
    /// Each stone's equations of the field's motion in its frame, its own motion eliminated.
    pub eliminated: Vec<Eliminated>,
    /// The same as equations of the field's unknowns: information and vector.
    pub of_stones: Vec<(Matrix9, Vector9)>,
}

/// The normal equations of the field, where the motions of stones beside it are as the problem's components and loose
/// prior say.
pub(crate) fn normal_equations<'a>(problem: &FieldProblem<'a>) -> Option<Normal<'a>> {
    let eliminated = eliminate_own_motions(problem, &problem.own_variances());
    let prior = prior(problem.graph, &problem.components, &problem.ties, &problem.least);
    assemble(problem, prior, eliminated)
}

/// The matrix of these equations: the information of prior and stones together, and that of each stone.
pub(crate) fn information(problem: &FieldProblem) -> (BlockMatrix<9>, Vec<Matrix9>) {
    let eliminated = eliminate_own_motions(problem, &problem.own_variances());
    let mut matrix = prior(problem.graph, &problem.components, &problem.ties, &problem.least);
    let of_stones = of_stones(problem, &eliminated);
    add_stones(&mut matrix, &of_stones);
    (matrix, of_stones.into_iter().map(|s| s.0).collect())
}

/// The stones' equations of the field's unknowns: information and vector.
fn of_stones(problem: &FieldProblem, eliminated: &[Eliminated]) -> Vec<(Matrix9, Vector9)> {
    let of_stone = |(i, stone): (usize, &Eliminated)| {
        let a = stone_from_field(&problem.graph.nodes[i].face_from_world);
        (
            a.transpose() * stone.information * a,
            a.transpose() * stone.vector,
        )
    };
    eliminated.par_iter().enumerate().map(of_stone).collect()
}

fn add_stones(matrix: &mut BlockMatrix<9>, of_stones: &[(Matrix9, Vector9)]) {
    let diagonal = matrix.diagonal.iter_mut().zip(of_stones);
    diagonal.for_each(|(sum, (information, _))| *sum += information);
}

/// `matrix`: the information of the prior.
pub(crate) fn assemble<'a>(
    problem: &FieldProblem<'a>,
    mut matrix: BlockMatrix<9>,
    eliminated: Vec<Eliminated>,
) -> Option<Normal<'a>> {
    let of_stones = of_stones(problem, &eliminated);
    add_stones(&mut matrix, &of_stones);
    let factor = problem.graph.pattern.factor(&matrix)?;
    let right: Vec<Vector9> = of_stones.iter().map(|s| s.1).collect();
    let state = factor.solve(&right);
    Some(Normal {
        factor,
        state,
        eliminated,
        of_stones,
    })
}

/// Solves for the field. `None` only where memory or the numbers fail.
pub(crate) fn solve(problem: &FieldProblem) -> Option<Field> {
    let normal = normal_equations(problem)?;
    let inverse = normal.factor.selected_inverse()?;
    let from_others = (0..problem.stones.len())
        .into_par_iter()
        .map(|i| {
            let a = stone_from_field(&problem.graph.nodes[i].face_from_world);
            without_own(&a, &normal.state[i], &inverse.diagonal[i], &normal.eliminated[i])
        })
        .collect();
    Some(Field {
        mean_covariance: mean_covariance(&normal.factor, problem.stones.len()),
        state: normal.state.into_iter().map(FieldVector::from).collect(),
        from_others,
        inverse,
    })
}

/// Covariance of the mean displacement over all stones: w' A^-1 w with w = 1/n at every stone's displacement.
fn mean_covariance(factor: &BlockFactor<9>, stones: usize) -> Matrix3<f64> {
    let share = 1.0 / stones.max(1) as f64;
    let weight = SMatrix::<f64, 9, 3>::identity() * share;
    let solved = factor.solve(&vec![weight; stones]);
    let covariance: Matrix3<f64> = solved.iter().map(|x| x.fixed_rows::<3>(0) * share).sum();
    0.5 * (covariance + covariance.transpose())
}

/// Takes a stone's own information back out of the field at the stone. `a` takes field unknowns to the
/// stone's motion.
fn without_own(a: &StoneFromField, state: &Vector9, covariance: &Matrix9, own: &Eliminated) -> Prediction {
    let mean: Vector6<f64> = a * state;
    let with: Matrix6<f64> = a * covariance * a.transpose();
    let (m, v) = (own.information, own.vector);
    // Q_l = Q (I - M Q)^-1, mu_l = (I - Q M)^-1 (mu - Q v): no inverse of Q, which may be nearly singular.
    let left = Matrix6::identity() - with * m;
    match left.try_inverse() {
        Some(inverse) => {
            let covariance = inverse * with;
            Prediction {
                mean: inverse * (mean - with * v),
                covariance: 0.5 * (covariance + covariance.transpose()),
            }
        }
        None => Prediction {
            mean,
            covariance: with,
        },
    }
}
