//! What the field is adjusted from.

use super::graph::Graph;
use super::loose_prior::LoosePrior;
use super::prior::Tie;
use super::variance_components::VarianceComponents;
use crate::registration::adjustment::observation::NormalEquations;

/// Stones, ties and variances for which the field of motion is sought.
#[derive(Clone)]
pub(crate) struct FieldProblem<'a> {
    pub graph: &'a Graph,
    /// One per node of the graph.
    pub stones: Vec<FieldStone<'a>>,
    /// One per edge of the graph.
    pub ties: Vec<Tie>,
    pub components: VarianceComponents,
    pub loose: LoosePrior,
}

/// A stone as the field sees it.
#[derive(Clone, Copy)]
pub(crate) struct FieldStone<'a> {
    pub equations: &'a NormalEquations,
    /// Probability that the stone moves with the field.
    pub p_with_field: f64,
}

impl FieldProblem<'_> {
    /// Variances of what stones do beside the field: those that move with it, and loose ones.
    pub fn own_variances(&self) -> [[f64; 9]; 2] {
        [
            self.components.own_variances(),
            self.loose.own_variances(&self.components),
        ]
    }
}
