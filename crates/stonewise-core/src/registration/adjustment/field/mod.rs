//! The smooth field of motion over the wall: its prior, its solution and its variance components.

mod component_estimate;
mod cracks;
mod creep;
mod eliminate;
mod field_vector;
mod graph;
mod jump;
mod loose_prior;
mod mixture;
mod motion_prior;
mod posterior;
mod prior;
mod problem;
mod solve;
mod subgraph;
#[cfg(test)]
pub(super) mod testing;
mod ties;
mod variance_components;

pub(crate) use component_estimate::most_likely_components;
#[cfg(test)]
pub(crate) use cracks::Crack;
pub(crate) use cracks::find_crack;
pub(crate) use creep::{LeftOver, creeping_zone};
pub(crate) use field_vector::{FieldVector, Matrix9, Vector9, stone_from_field};
pub(crate) use graph::{Edge, Graph, Node, Place};
pub(crate) use loose_prior::{LoosePrior, estimated_share};
pub(crate) use mixture::{log_odds_of_loose, probabilities_with_field};
pub(crate) use motion_prior::MotionPrior;
pub(crate) use posterior::{Posterior, Prediction, covariance_against, posterior};
pub(crate) use prior::{Least, Tie, of_tie, prior};
pub(crate) use problem::{FieldProblem, FieldStone, PhotoTerms};
pub(crate) use solve::{Field, information, solve};
pub(crate) use subgraph::{Displacement, Subgraph};
pub(crate) use ties::reweight_ties;
pub use variance_components::VarianceComponents;
pub(crate) use variance_components::{LEAST_APPEARANCE_M, START_APPEARANCE_M};
