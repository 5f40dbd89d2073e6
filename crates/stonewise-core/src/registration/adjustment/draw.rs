//! Motions drawn from what the adjustment assumes of a wall beforehand.

use super::field::{
    Graph, Least, LoosePrior, Node, Place, Tie, VarianceComponents, Vector9, prior, stone_from_field,
};
use super::params::AdjustmentParams;
use super::stone_vector::StoneVector;
use crate::registration::random::Random;
use nalgebra::{DMatrix, DVector, Point3, Vector3, Vector6};

/// The drawn motion of a stone, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnMotion {
    /// Displacement of its centroid, metres.
    pub displacement: Vector3<f64>,
    /// Rotation vector, radians.
    pub rotation: Vector3<f64>,
    /// The part of the displacement that it shares with its neighbours, metres.
    pub shared: Vector3<f64>,
    /// Whether it is loose.
    pub loose: bool,
}

/// Draws motions from the prior of [`adjust`](crate::registration::adjust): the variance components, the ties, a field
/// under them, and what each stone does beside it. `stones`: centroid and outward normal of each.
///
/// The prior leaves the mean displacement of all stones open; it is taken off. `None` where the prior cannot be
/// factored. Cost: cubic in the stones.
pub fn draw_motions(
    stones: &[(Point3<f64>, Vector3<f64>)],
    params: &AdjustmentParams,
    seed: u64,
) -> Option<Vec<DrawnMotion>> {
    let place = |&(centroid, normal): &(Point3<f64>, Vector3<f64>)| Place {
        centroid,
        normal,
        weight: 1.0,
    };
    let places: Vec<Place> = stones.iter().map(place).collect();
    let graph = Graph::new(&places, params.neighbours_per_side)?;
    let mut random = Random::new(seed);
    let components = VarianceComponents::drawn(&mut random);
    let freedom = params.tie_freedom.round().max(1.0);
    let mut tie = || Tie {
        weight: (0..freedom as usize)
            .map(|_| random.normal().powi(2))
            .sum::<f64>()
            / freedom,
        ..Tie::WHOLE
    };
    let ties: Vec<Tie> = graph.edges.iter().map(|_| tie()).collect();
    let field = draw_field(&graph, &components, &ties, &mut random)?;
    let displacements = field.iter().map(|f| f.fixed_rows::<3>(0).into_owned());
    let mean = displacements.sum::<Vector3<f64>>() / field.len().max(1) as f64;
    let loose = LoosePrior {
        share: params.loose_share,
        move_m: params.loose_move_m,
        turn_rad: params.loose_turn_rad,
    };
    let motion = |(node, mut field): (&Node, Vector9)| {
        let is_loose = random.uniform() < loose.share;
        let own = match is_loose {
            true => loose.own_variances(&components),
            false => components.own_variances(),
        };
        let mut displaced = field.fixed_rows_mut::<3>(0);
        displaced -= mean;
        let with_field = stone_from_field(&node.face_from_world) * field;
        let own = Vector6::from(own).map(|variance| variance.sqrt() * random.normal());
        let stone = StoneVector::from(with_field + own);
        let world_from_face = node.face_from_world.transpose();
        DrawnMotion {
            displacement: world_from_face * stone.translation(),
            rotation: world_from_face * stone.rotation(),
            shared: world_from_face * StoneVector::from(with_field).translation(),
            loose: is_loose,
        }
    };
    Some(graph.nodes.iter().zip(field).map(motion).collect())
}

/// A field whose information matrix is that of the prior: with Q = L L', L'^-1 z for standard normal z.
fn draw_field(
    graph: &Graph,
    components: &VarianceComponents,
    ties: &[Tie],
    random: &mut Random,
) -> Option<Vec<Vector9>> {
    let stones = graph.nodes.len();
    let blocks = prior(graph, components, ties, &vec![Least::default(); stones]);
    // Of the symmetric matrix, the factor reads the lower half.
    let mut matrix = DMatrix::zeros(9 * stones, 9 * stones);
    for (i, block) in blocks.diagonal.iter().enumerate() {
        matrix.view_mut((9 * i, 9 * i), (9, 9)).copy_from(block);
    }
    for (edge, block) in graph.edges.iter().zip(&blocks.edges) {
        matrix
            .view_mut((9 * edge.high, 9 * edge.low), (9, 9))
            .copy_from(block);
    }
    let normal = DVector::from_fn(9 * stones, |_, _| random.normal());
    let all = matrix.cholesky()?.l_dirty().tr_solve_lower_triangular(&normal)?;
    Some(
        all.as_slice()
            .chunks_exact(9)
            .map(Vector9::from_column_slice)
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::field::testing::places;

    /// Given the gradients at both ends of a tie of length L, the displacement differs by q^2 L^3 / 12 (Wahba 1978).
    #[test]
    fn neighbours_differ_as_an_integrated_random_walk() {
        let graph = Graph::new(&places(2, 1), 1).unwrap();
        let components = VarianceComponents::start();
        let [edge] = graph.edges.as_slice() else {
            panic!("{} ties", graph.edges.len())
        };
        let mut random = Random::new(5);
        let mut squares = [0.0; 3];
        let draws = 4000;
        for _ in 0..draws {
            let field = draw_field(&graph, &components, &[Tie::WHOLE], &mut random).unwrap();
            let at = |end: usize, k: usize| field[end].fixed_rows::<3>(3 * k).into_owned();
            let slope = |k: usize| 0.5 * edge.step[k - 1] * (at(edge.low, k) + at(edge.high, k));
            let left = at(edge.high, 0) - at(edge.low, 0) - slope(1) - slope(2);
            let left = edge.face_from_world * left;
            (0..3).for_each(|k| squares[k] += left[k] * left[k] / f64::from(draws));
        }
        let expected = |k: usize| components.drift[k].powi(2) * edge.length_m.powi(3) / 12.0;
        for (square, k) in squares.into_iter().zip([0, 0, 1]) {
            assert!((square / expected(k) - 1.0).abs() < 0.1, "{squares:?}");
        }
    }

    #[test]
    fn loose_stones_are_as_many_and_move_as_far_as_assumed() {
        let stones: Vec<_> = places(8, 6).iter().map(|p| (p.centroid, p.normal)).collect();
        let params = AdjustmentParams {
            loose_share: 0.2,
            ..AdjustmentParams::default()
        };
        let drawn: Vec<DrawnMotion> = (0..40)
            .flat_map(|seed| draw_motions(&stones, &params, seed).unwrap())
            .collect();
        let own: Vec<f64> = { drawn.iter() }
            .filter(|m| m.loose)
            .map(|m| (m.displacement - m.shared).norm_squared() / 3.0)
            .collect();
        let share = own.len() as f64 / drawn.len() as f64;
        assert!((share - 0.2).abs() < 0.03, "{share}");
        let sd = (own.iter().sum::<f64>() / own.len() as f64).sqrt();
        assert!((sd / params.loose_move_m - 1.0).abs() < 0.1, "{sd}");
        let mean = drawn.iter().map(|m| m.shared).sum::<Vector3<f64>>() / drawn.len() as f64;
        assert!(mean.norm() < 1e-9, "{mean}");
    }
}
