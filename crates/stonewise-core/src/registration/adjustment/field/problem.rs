//! What the field is adjusted from.

use super::graph::Graph;
use super::loose_prior::LoosePrior;
use super::prior::{Least, Tie};
use super::variance_components::VarianceComponents;
use crate::registration::adjustment::candidate::Moving;
use crate::registration::adjustment::observation::NormalEquations;
use crate::registration::adjustment::observation::photo::StonePhotos;
use crate::registration::adjustment::observation::surface::with_error_likelihood;
use crate::registration::adjustment::stone_vector::StoneVector;

/// Stones, ties and variances for which the field of motion is sought.
#[derive(Clone)]
pub(crate) struct FieldProblem<'a> {
    pub graph: &'a Graph,
    /// One per node of the graph.
    pub stones: Vec<FieldStone<'a>>,
    /// One per edge of the graph.
    pub ties: Vec<Tie>,
    /// One per node of the graph.
    pub least: Vec<Least>,
    pub components: VarianceComponents,
    pub loose: LoosePrior,
    /// What photos say, where the variance components are to be estimated from them too; the stones'
    /// equations are then those of the clouds alone.
    pub photos: Option<PhotoTerms<'a>>,
}

/// What photos say of each stone, and the motion about which its equations are.
#[derive(Clone)]
pub(crate) struct PhotoTerms<'a> {
    /// One per stone.
    pub stones: Vec<(Option<&'a StonePhotos>, StoneVector)>,
}

impl PhotoTerms<'_> {
    /// Clouds and photos joined, each with its error in the face. Constants hold what depends on these
    /// errors.
    pub fn join(&self, problem: &FieldProblem, components: &VarianceComponents) -> Vec<NormalEquations> {
        let of_stone = |(stone, (photos, origin)): (&FieldStone, &(Option<&StonePhotos>, StoneVector))| {
            let mut sum = NormalEquations {
                constant: 0.0,
                ..stone.equations.clone()
            };
            if sum.information.trace() > 0.0 {
                sum = with_error_likelihood(sum, components.error_m);
            }
            if let Some(photos) = photos {
                let moving = Moving::more_probable(stone.p_with_field);
                sum += photos.normal_equations(origin, components.appearance_m(), moving);
            }
            sum
        };
        problem.stones.iter().zip(&self.stones).map(of_stone).collect()
    }
}

/// A stone as the field sees it.
#[derive(Clone, Copy)]
pub(crate) struct FieldStone<'a> {
    pub equations: &'a NormalEquations,
    /// Probability that the stone moves with the field.
    pub p_with_field: f64,
}

impl<'a> FieldProblem<'a> {
    /// The problem with other equations of the stones.
    pub fn with_equations<'b>(&'b self, equations: &'b [NormalEquations]) -> FieldProblem<'b>
    where
        'a: 'b,
    {
        let stones = self.stones.iter().zip(equations);
        FieldProblem {
            graph: self.graph,
            stones: stones
                .map(|(stone, equations)| FieldStone { equations, ..*stone })
                .collect(),
            ties: self.ties.clone(),
            least: self.least.clone(),
            components: self.components,
            loose: self.loose,
            photos: None,
        }
    }

    /// Variances of what stones do beside the field: those that move with it, and loose ones.
    pub fn own_variances(&self) -> [[f64; 6]; 2] {
        [
            self.components.own_variances(),
            self.loose.own_variances(&self.components),
        ]
    }
}
