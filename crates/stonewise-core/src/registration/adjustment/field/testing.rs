//! A small wall with random equations, for tests.

use super::graph::{Graph, Place};
use super::loose_prior::LoosePrior;
use super::prior::{Least, Tie};
use super::problem::{FieldProblem, FieldStone};
use super::variance_components::VarianceComponents;
use crate::registration::adjustment::observation::NormalEquations;
use nalgebra::{Matrix6, Point3, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub(crate) const LOOSE: LoosePrior = LoosePrior {
    share: 0.03,
    move_m: 0.015,
    turn_rad: 0.02,
};

/// Places on a leaning wall, in rows of stones 30 cm wide and 20 cm high.
pub(crate) fn places(columns: u32, rows: u32) -> Vec<Place> {
    let place = |k: u32| Place {
        centroid: Point3::new(
            0.01 * f64::from(k % 3),
            0.3 * f64::from(k % columns),
            0.2 * f64::from(k / columns),
        ),
        normal: Vector3::new(1.0, 0.1, 0.2).normalize(),
        weight: 100.0,
    };
    (0..columns * rows).map(place).collect()
}

/// A wall whose stones have random normal equations.
pub(crate) struct SmallWall {
    pub graph: Graph,
    pub equations: Vec<NormalEquations>,
}

impl SmallWall {
    pub fn new(columns: u32, rows: u32, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let graph = Graph::new(&places(columns, rows), 2).unwrap();
        let equations = graph
            .nodes
            .iter()
            .map(|_| {
                let m = Matrix6::from_fn(|_, _| rng.random_range(-1.0..1.0));
                NormalEquations {
                    information: (m * m.transpose() + Matrix6::identity()) * 1e5,
                    vector: Vector6::from_fn(|_, _| rng.random_range(-1.0..1.0)) * 1e3,
                    constant: 0.0,
                }
            })
            .collect();
        Self { graph, equations }
    }

    /// All ties whole; every stone moves with the field with the same probability.
    pub fn problem(&self, p_with_field: f64) -> FieldProblem<'_> {
        let stone = |equations| FieldStone {
            equations,
            p_with_field,
        };
        FieldProblem {
            graph: &self.graph,
            stones: self.equations.iter().map(stone).collect(),
            ties: vec![Tie::WHOLE; self.graph.edges.len()],
            least: vec![Least::default(); self.graph.nodes.len()],
            components: VarianceComponents::start(),
            loose: LOOSE,
            photos: None,
        }
    }
}
