//! Common jumps of the motion between two sides of the wall.

use super::problem::FieldProblem;
use super::solve::{Normal, normal_equations};
use nalgebra::{Matrix3, SMatrix, Vector3};
use rayon::prelude::*;

/// A jump of the motion between two sides of the wall, beyond what the ties between them allow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jump {
    /// Motion of the side that moved against the other, world, metres.
    pub jump: Vector3<f64>,
    /// Its square in units of its covariance: chi-square with three degrees of freedom where nothing jumped.
    pub excess: f64,
}

/// Ways that one solve tests: it reads the factor once for the right-hand sides of all of them.
const WAYS: usize = 3;

/// Estimates, for each way to part the stones into two sides, the common jump of the stones marked `true`.
///
/// The jump is three more unknowns of the adjustment: with P the matrix of the field and Q the jump's
/// columns, its information is R - Q' P^-1 Q, and P need not be factored again. Cost: one solve for every
/// [`WAYS`] ways, with three right-hand sides for each way. `None` where the equations cannot be factored.
pub(crate) fn test_jumps(problem: &FieldProblem, sides: &[Vec<bool>]) -> Option<Vec<Jump>> {
    let normal = normal_equations(problem)?;
    let stones = normal.of_stones.iter().zip(&normal.state);
    let left: Vec<Vector3<f64>> = stones
        .map(|((m, v), state)| (v - m * state).fixed_rows::<3>(0).into_owned())
        .collect();
    Some(
        sides
            .par_chunks(WAYS)
            .flat_map_iter(|ways| test_ways(&normal, &left, ways))
            .collect(),
    )
}

/// `left`: residual of each stone's equations of the field's displacement; `ways`: at most [`WAYS`].
fn test_ways(normal: &Normal, left: &[Vector3<f64>], ways: &[Vec<bool>]) -> Vec<Jump> {
    let columns = normal.of_stones.iter().enumerate().map(|(i, (m, _))| {
        let mut columns = SMatrix::<f64, 9, { 3 * WAYS }>::zeros();
        for (way, _) in ways.iter().enumerate().filter(|(_, side)| side[i]) {
            columns
                .fixed_columns_mut::<3>(3 * way)
                .copy_from(&m.fixed_columns::<3>(0));
        }
        columns
    });
    let solved = normal.factor.solve(&columns.collect::<Vec<_>>());
    let jump = |(way, side): (usize, &Vec<bool>)| {
        let mut information = Matrix3::zeros();
        let mut vector = Vector3::zeros();
        for i in (0..side.len()).filter(|&i| side[i]) {
            let (m, _) = &normal.of_stones[i];
            information += m.fixed_view::<3, 3>(0, 0);
            vector += left[i];
            information -= m.fixed_rows::<3>(0) * solved[i].fixed_columns::<3>(3 * way);
        }
        Jump::of(&information, &vector)
    };
    ways.iter().enumerate().map(jump).collect()
}

impl Jump {
    /// The jump that these equations determine; zero where they determine none.
    fn of(information: &Matrix3<f64>, vector: &Vector3<f64>) -> Self {
        let information = 0.5 * (information + information.transpose());
        match information.cholesky() {
            Some(factor) => {
                let jump = factor.solve(vector);
                Self {
                    jump,
                    excess: jump.dot(vector),
                }
            }
            None => Self {
                jump: Vector3::zeros(),
                excess: 0.0,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::BlockMatrix;
    use crate::registration::adjustment::field::eliminate::eliminate_own_motions;
    use crate::registration::adjustment::field::field_vector::stone_from_field;
    use crate::registration::adjustment::field::field_vector::{Matrix9, Vector9};
    use crate::registration::adjustment::field::prior::prior;
    use crate::registration::adjustment::field::testing::SmallWall;
    use nalgebra::{DMatrix, DVector};

    /// A jump and its excess, from the whole matrix with three more unknowns, densely.
    fn dense_jump(
        matrix: &BlockMatrix<9>,
        problem: &FieldProblem,
        of_stone: &[(Matrix9, Vector9)],
        side: &[bool],
    ) -> Jump {
        let n = problem.graph.nodes.len();
        let mut whole = DMatrix::<f64>::zeros(9 * n + 3, 9 * n + 3);
        let mut rhs = DVector::<f64>::zeros(9 * n + 3);
        for (i, d) in matrix.diagonal.iter().enumerate() {
            whole.view_mut((9 * i, 9 * i), (9, 9)).copy_from(d);
        }
        for (e, edge) in problem.graph.edges.iter().enumerate() {
            let block = &matrix.edges[e];
            whole
                .view_mut((9 * edge.high, 9 * edge.low), (9, 9))
                .copy_from(block);
            whole
                .view_mut((9 * edge.low, 9 * edge.high), (9, 9))
                .copy_from(&block.transpose());
        }
        for (i, (m, v)) in of_stone.iter().enumerate() {
            rhs.rows_mut(9 * i, 9).copy_from(v);
            if side[i] {
                let mut corner = whole.view_mut((9 * n, 9 * n), (3, 3));
                corner += m.fixed_view::<3, 3>(0, 0);
                whole
                    .view_mut((9 * i, 9 * n), (9, 3))
                    .copy_from(&m.fixed_columns::<3>(0));
                whole
                    .view_mut((9 * n, 9 * i), (3, 9))
                    .copy_from(&m.fixed_rows::<3>(0));
                let mut tail = rhs.rows_mut(9 * n, 3);
                tail += v.fixed_rows::<3>(0);
            }
        }
        let inverse = whole.try_inverse().unwrap();
        let solution = &inverse * rhs;
        let jump = Vector3::new(solution[9 * n], solution[9 * n + 1], solution[9 * n + 2]);
        let covariance: Matrix3<f64> = inverse.fixed_view::<3, 3>(9 * n, 9 * n).into_owned();
        Jump {
            jump,
            excess: jump.dot(&covariance.try_inverse().map_or(jump, |i| i * jump)),
        }
    }

    #[test]
    fn a_jump_is_that_of_an_adjustment_with_three_more_unknowns() {
        let wall = SmallWall::new(4, 3, 3);
        let problem = wall.problem(0.9);
        // More ways than one solve tests.
        let sides: Vec<Vec<bool>> = (1..3)
            .map(|row| (0..12).map(|k| k / 4 >= row).collect())
            .chain((1..4).map(|column| (0..12).map(|k| k % 4 >= column).collect()))
            .collect();
        assert!(sides.len() > WAYS && !sides.len().is_multiple_of(WAYS));
        let found = test_jumps(&problem, &sides).unwrap();
        let unmoved = test_jumps(&problem, &[vec![false; 12]]).unwrap()[0];
        assert_eq!((unmoved.jump, unmoved.excess), (Vector3::zeros(), 0.0));
        let mut matrix = prior(&wall.graph, &problem.components, &problem.ties, &problem.least);
        let of_stone: Vec<(Matrix9, Vector9)> = eliminate_own_motions(&problem, &problem.own_variances())
            .iter()
            .zip(&wall.graph.nodes)
            .map(|(own, node)| {
                let a = stone_from_field(&node.face_from_world);
                (a.transpose() * own.information * a, a.transpose() * own.vector)
            })
            .collect();
        for (d, (m, _)) in matrix.diagonal.iter_mut().zip(&of_stone) {
            *d += m;
        }
        assert_eq!(found.len(), sides.len());
        for (found, side) in found.iter().zip(&sides) {
            let expected = dense_jump(&matrix, &problem, &of_stone, side);
            assert!((found.jump - expected.jump).norm() < 1e-9 + 1e-6 * expected.jump.norm());
            assert!(
                (found.excess / expected.excess - 1.0).abs() < 1e-6,
                "{found:?} {expected:?}"
            );
        }
    }
}
