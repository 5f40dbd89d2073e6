//! The motion of every matched stone, from its points in both epochs.
//!
//! [`adjust`] is the default: all stones together, as surveyors adjust a network.

mod band;
mod correlation;
mod equations;
mod excerpt;
mod field;
mod graph;
mod hyper;
mod network;
mod noise;
mod outcome;
mod pairs;
mod params;
mod patch;
mod sparse;
mod survey;
mod track;

pub use hyper::VarianceComponents;
pub use network::{AdjustError, adjust};
pub use pairs::{MemoryPairs, PairPoints, PairSource};
pub use params::{Break, NetworkParams, NetworkReport};
