//! Factors of the two kinds of matrix that the adjustment solves: bands and sparse blocks. Nothing here
//! refers to stones.

mod band;
mod block;
mod selected_inverse;

pub(crate) use band::{Band, BandFactor, BandInverse};
pub(crate) use block::{BlockFactor, BlockMatrix, BlockPattern};
pub(crate) use selected_inverse::SelectedInverse;
