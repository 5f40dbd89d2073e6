//! The field's prior: an integrated random walk over the graph of neighbours.
//!
//! Neighbours are tied: the displacement changes as the mean gradient says, the gradient changes slowly.
//! Rigid motion and tilt cost nothing, even strain only what `strain` allows.

use super::graph::{Edge, Graph};
use super::variance_components::VarianceComponents;
use crate::linalg::BlockMatrix;
use crate::registration::adjustment::field::field_vector::Matrix9;
use nalgebra::{Matrix3, Vector3};

/// The state of the tie between two neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tie {
    /// Factor on the tie's information: 1 whole, towards 0 broken.
    pub weight: f64,
    /// A crack of the wall lies between: the displacement may jump there, its gradient goes on.
    pub is_parted: bool,
}

impl Tie {
    /// The tie of neighbours between which nothing is broken.
    pub const WHOLE: Self = Self {
        weight: 1.0,
        is_parted: false,
    };
}

/// The least that is assumed of how the motion changes around a stone, as [`VarianceComponents`] has it: in the face,
/// out of it. More than none where a zone creeps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Least {
    pub drift: [f64; 2],
    pub strain: [f64; 2],
}

impl Least {
    /// The larger of both, each by itself.
    pub fn larger(&self, other: &Self) -> Self {
        let larger = |a: [f64; 2], b: [f64; 2]| [0, 1].map(|k| a[k].max(b[k]));
        Self {
            drift: larger(self.drift, other.drift),
            strain: larger(self.strain, other.strain),
        }
    }

    /// These components, or the least where they are smaller.
    pub fn of(&self, components: &VarianceComponents) -> VarianceComponents {
        VarianceComponents {
            drift: [0, 1].map(|k| components.drift[k].max(self.drift[k])),
            strain: [0, 1].map(|k| components.strain[k].max(self.strain[k])),
            ..*components
        }
    }
}

/// The components of the tie between two stones: the larger of both.
pub(crate) fn of_tie(edge: &Edge, components: &VarianceComponents, least: &[Least]) -> VarianceComponents {
    least[edge.low].larger(&least[edge.high]).of(components)
}

/// Prior standard deviation of a displacement about the common motion, metres. It keeps the datum of the
/// field solvable; 0.3 m is ten times any motion that stones are matched over, so it does not pull.
const LEVEL_M: f64 = 0.3;
/// Largest information of a tie, 1/m^2: no tie is stiffer than a micrometre, which is what double precision
/// can factor beside ties of a metre.
const STIFFEST: f64 = 1e12;

/// Information matrix of the prior. `least`: around each stone.
pub(crate) fn prior(
    graph: &Graph,
    components: &VarianceComponents,
    ties: &[Tie],
    least: &[Least],
) -> BlockMatrix<9> {
    let mut matrix = graph.pattern.zeros();
    for (e, (edge, tie)) in graph.edges.iter().zip(ties).enumerate() {
        let around = of_tie(edge, components, least);
        let [ll, hl, hh] = tie_blocks(edge, &around, tie.is_parted);
        let w = tie.weight;
        matrix.diagonal[edge.low] += ll * w;
        matrix.diagonal[edge.high] += hh * w;
        matrix.edges[e] += hl * w;
    }
    for ((node, least), block) in graph.nodes.iter().zip(least).zip(&mut matrix.diagonal) {
        let strain = least.of(components).strain.map(|s| s * s);
        let strain = in_and_out(&node.face_from_world, strain);
        for c in 0..3 {
            block[(c, c)] += 1.0 / (LEVEL_M * LEVEL_M);
        }
        for g in [3, 6] {
            let mut view = block.fixed_view_mut::<3, 3>(g, g);
            view += strain;
        }
    }
    matrix
}

/// Information of one tie: low-low, high-low, high-high; of a parted one only the gradients are tied.
///
/// Over a length L an integrated random walk of drift q adds q^2 L to the variance of the gradient and, given
/// the gradients at both ends, q^2 L^3 / 12 to that of the displacement (Wahba 1978: the smoothing spline's
/// prior).
pub(crate) fn tie_blocks(edge: &Edge, components: &VarianceComponents, is_parted: bool) -> [Matrix9; 3] {
    let length = edge.length_m;
    let level = match is_parted {
        true => Matrix3::zeros(),
        false => in_and_out(
            &edge.face_from_world,
            components.drift.map(|q| q * q * length.powi(3) / 12.0),
        ),
    };
    let slope = in_and_out(&edge.face_from_world, components.drift.map(|q| q * q * length));
    let half = edge.step.map(|s| -0.5 * s);
    let low = [-1.0, half[0], half[1]];
    let high = [1.0, half[0], half[1]];

    let outer = |p: &[f64; 3], q: &[f64; 3], own: f64| {
        let mut block = Matrix9::zeros();
        for (a, pa) in p.iter().enumerate() {
            for (b, qb) in q.iter().enumerate() {
                let mut part = level * (pa * qb);
                if a == b && a > 0 {
                    part += slope * own;
                }
                block.fixed_view_mut::<3, 3>(3 * a, 3 * b).copy_from(&part);
            }
        }
        block
    };

    [
        outer(&low, &low, 1.0),
        outer(&high, &low, -1.0),
        outer(&high, &high, 1.0),
    ]
}

/// World information of a vector with these variances in the face and out of it.
fn in_and_out(face_from_world: &Matrix3<f64>, variance: [f64; 2]) -> Matrix3<f64> {
    let [i, o] = variance.map(|v| (1.0 / v).min(STIFFEST));
    face_from_world.transpose() * Matrix3::from_diagonal(&Vector3::new(i, i, o)) * face_from_world
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::field::testing::SmallWall;

    #[test]
    fn a_least_around_all_stones_is_as_components_of_that_size() {
        let wall = SmallWall::new(4, 3, 1);
        let ties = vec![Tie::WHOLE; wall.graph.edges.len()];
        let small = VarianceComponents::start();
        let large = VarianceComponents {
            drift: [0.02, small.drift[1]],
            strain: [small.strain[0], 0.05],
            ..small
        };
        let everywhere = Least {
            drift: [0.02, 1e-3],
            strain: [1e-3, 0.05],
        };
        let stones = wall.graph.nodes.len();
        let found = prior(&wall.graph, &small, &ties, &vec![everywhere; stones]);
        let expected = prior(&wall.graph, &large, &ties, &vec![Least::default(); stones]);
        assert_eq!(found.diagonal, expected.diagonal);
        assert_eq!(found.edges, expected.edges);
    }
}
