//! The weights of the ties between neighbours, and the drift that goes with them.

use super::graph::Graph;
use super::prior::{Least, Tie, of_tie, tie_blocks};
use super::solve::Field;
use super::variance_components::{BOUNDS, VarianceComponents};
use crate::switches::where_on;
use rayon::prelude::*;

/// A drift so large that a tie of it says nothing, per square root metre.
const NO_TIE: f64 = 1e9;

/// Weights of the ties and the drift that goes with them: one step of expectation maximisation for a
/// multivariate t law with `freedom` degrees of freedom (Liu, Rubin & Wu 1998, parameter-expanded).
///
/// Parted ties keep their weight: their displacements are not tied at all.
pub(crate) fn reweight_ties(
    graph: &Graph,
    field: &Field,
    freedom: f64,
    components: &mut VarianceComponents,
    least: &[Least],
    ties: &mut [Tie],
) {
    let strain = tie_strain(graph, field, components, least);
    // Ties outnumber stones: each holds a share of the field's nine freedoms, six of them in the face.
    let share = graph.nodes.len() as f64 / strain.len().max(1) as f64;
    let mut sums = [0.0; 3];
    for (tie, s) in ties.iter_mut().zip(&strain) {
        if tie.is_parted {
            tie.weight = 1.0;
            continue;
        }
        tie.weight = where_on("tie_t", (freedom + 9.0 * share) / (freedom + s[0] + s[1]), 1.0);
        sums[0] += tie.weight * s[0] / (6.0 * share);
        sums[1] += tie.weight * s[1] / (3.0 * share);
        sums[2] += tie.weight;
    }
    if sums[2] > 0.0 {
        for k in 0..2 {
            components.drift[k] =
                (components.drift[k] * (sums[k] / sums[2]).sqrt()).clamp(BOUNDS[k][0], BOUNDS[k][1]);
        }
    }
}

/// Expected squared standardised strain of each tie as if it were whole: six components in the face, three
/// out.
fn tie_strain(
    graph: &Graph,
    field: &Field,
    components: &VarianceComponents,
    least: &[Least],
) -> Vec<[f64; 2]> {
    graph
        .edges
        .par_iter()
        .enumerate()
        .map(|(e, edge)| {
            let [inside, outside] = of_tie(edge, components, least).drift;
            [[inside, NO_TIE], [NO_TIE, outside]].map(|drift| {
                let part = VarianceComponents { drift, ..*components };
                let blocks = tie_blocks(edge, &part, false);
                let (low, high) = (
                    field.state[edge.low].unknowns(),
                    field.state[edge.high].unknowns(),
                );
                let mean = (low.transpose() * blocks[0] * low + high.transpose() * blocks[2] * high)[0]
                    + 2.0 * (high.transpose() * blocks[1] * low)[0];
                let spread = (blocks[0] * field.inverse.diagonal[edge.low]).trace()
                    + (blocks[2] * field.inverse.diagonal[edge.high]).trace()
                    + 2.0 * (blocks[1].transpose() * field.inverse.edges[e]).trace();
                (mean + spread).max(0.0)
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::field::solve::solve;
    use crate::registration::adjustment::field::testing::SmallWall;
    use crate::registration::adjustment::stone_vector::StoneVector;
    use nalgebra::{Matrix6, Vector3, Vector6};

    /// Stones observed to half a millimetre; from the fourth column on the wall moved by `jump` across the
    /// face.
    fn wall(jump: f64) -> SmallWall {
        let mut wall = SmallWall::new(8, 5, 1);
        let weights = Vector6::from([4e6, 4e6, 4e6, 1e4, 1e4, 1e4]);
        for (k, equations) in wall.equations.iter_mut().enumerate() {
            let shift = Vector3::new(0.0, 0.0, if k % 8 >= 4 { jump } else { 0.0 });
            equations.information = Matrix6::from_diagonal(&weights);
            equations.vector = equations.information * StoneVector::from_translation(shift).unknowns();
        }
        wall
    }

    fn reweighted(wall: &SmallWall, parted: bool) -> (Vec<Tie>, VarianceComponents) {
        let mut problem = wall.problem(1.0);
        for (tie, edge) in problem.ties.iter_mut().zip(&wall.graph.edges) {
            tie.is_parted = parted && (edge.low % 8 >= 4) != (edge.high % 8 >= 4);
        }
        for _ in 0..6 {
            let field = solve(&problem).unwrap();
            let (mut components, mut ties) = (problem.components, problem.ties.clone());
            reweight_ties(
                &wall.graph,
                &field,
                3.0,
                &mut components,
                &problem.least,
                &mut ties,
            );
            (problem.components, problem.ties) = (components, ties);
        }
        (problem.ties, problem.components)
    }

    #[test]
    fn ties_over_a_jump_lose_their_weight_and_the_others_keep_it() {
        let wall = wall(0.05);
        let (ties, _) = reweighted(&wall, false);
        let mean = |crosses: bool| {
            let of = |e: &crate::registration::adjustment::field::graph::Edge| {
                ((e.low % 8 >= 4) != (e.high % 8 >= 4)) == crosses
            };
            let weights: Vec<f64> = ties
                .iter()
                .zip(&wall.graph.edges)
                .filter(|(_, e)| of(e))
                .map(|(t, _)| t.weight)
                .collect();
            weights.iter().sum::<f64>() / weights.len() as f64
        };
        assert!(mean(true) < 0.3 * mean(false), "{} {}", mean(true), mean(false));
    }

    #[test]
    fn parted_ties_stay_whole_and_do_not_loosen_the_others() {
        let (ties, components) = reweighted(&wall(0.05), true);
        assert!(ties.iter().all(|t| !t.is_parted || t.weight == 1.0));
        let (_, still) = reweighted(&wall(0.0), false);
        for k in 0..2 {
            assert!(
                components.drift[k] < 1.5 * still.drift[k],
                "{components:?} {still:?}"
            );
        }
    }
}
