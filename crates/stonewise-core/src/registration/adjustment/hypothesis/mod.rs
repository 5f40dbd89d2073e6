//! Whether a stone moved with the field or on its own.

mod likelihood_ratio;
mod probing;

pub(crate) use likelihood_ratio::{LikelihoodRatioTest, Placed};
pub(crate) use probing::Probe;
