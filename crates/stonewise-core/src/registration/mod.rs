//! The motion of every matched stone, from its points in both epochs.
//!
//! [`adjust`] is the default: all stones together, as surveyors adjust a network. [`align`] is the paper's way: every
//! stone by itself, with its surroundings.

mod band;
mod border;
mod breaks;
mod correlation;
mod datum;
mod discount;
mod equations;
mod excerpt;
mod field;
mod gicp;
mod graph;
mod hyper;
mod network;
mod noise;
mod outcome;
mod pairs;
mod params;
mod patch;
mod rivals;
mod sparse;
mod survey;
mod track;

pub use border::{NearPoint, StonePoints, Window, local_shifts, stone_points};
pub use datum::DatumError;
pub use gicp::{GicpBlock, GicpParams, GicpStart, GicpStone, align, relate_to_neighbours};
pub use hyper::VarianceComponents;
pub use network::{AdjustError, adjust};
pub use pairs::{MemoryPairs, PairPoints, PairSource};
pub use params::{Break, NetworkParams, NetworkReport};
