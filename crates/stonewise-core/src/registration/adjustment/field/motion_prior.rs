//! What is assumed of the stones' motions between one solution and the next.

use super::cracks::Crack;
use super::graph::{Graph, Place};
use super::loose_prior::LoosePrior;
use super::prior::{Least, Tie};
use super::variance_components::VarianceComponents;
use crate::geometry::SmallMotion;
use crate::registration::adjustment::stone_vector::StoneVector;
use nalgebra::Vector3;

/// Which stones are neighbours, how stiff the ties between them are, and what stones do on their own.
pub(crate) struct MotionPrior {
    pub graph: Graph,
    /// One per edge of the graph.
    pub ties: Vec<Tie>,
    /// The least change of the motion in zones that creep, one per node of the graph.
    pub least: Vec<Least>,
    pub components: VarianceComponents,
    pub loose: LoosePrior,
    pub cracks: Vec<Crack>,
    /// Number of zones that were found to creep.
    pub zones: usize,
    /// Common motion about which the field is solved, world.
    pub common: SmallMotion,
}

impl MotionPrior {
    /// All ties are whole, and nothing is known of the common motion. `None` where memory does not suffice.
    pub fn new(places: &[Place], neighbours_per_side: usize, loose: LoosePrior) -> Option<Self> {
        let graph = Graph::new(places, neighbours_per_side)?;
        Some(Self {
            ties: vec![Tie::WHOLE; graph.edges.len()],
            least: vec![Least::default(); graph.nodes.len()],
            graph,
            components: VarianceComponents::start(),
            loose,
            cracks: Vec::new(),
            zones: 0,
            common: SmallMotion::shift(Vector3::zeros()),
        })
    }

    /// The common motion in a stone's frame.
    pub fn common_in(&self, i: usize) -> StoneVector {
        let node = &self.graph.nodes[i];
        StoneVector::from_rigid(
            node.face_from_world * self.common.at(&node.centroid),
            node.face_from_world * self.common.rotation(),
        )
    }

    /// Variances of the (translation, rotation) that a stone of the field makes on its own, in its frame.
    pub fn own_variances(&self) -> [f64; 6] {
        self.components.own_variances()
    }

    /// Variances of the motion that a loose stone makes on its own.
    pub fn loose_variances(&self) -> [f64; 6] {
        self.loose.own_variances(&self.components)
    }

    /// Parts all ties between the two sides of a crack.
    pub fn part_along(&mut self, crack: Crack) {
        for (tie, edge) in self.ties.iter_mut().zip(&self.graph.edges) {
            tie.is_parted |= crack.side[edge.low] != crack.side[edge.high];
        }
        self.cracks.push(crack);
    }
}
