//! Factors of the kinds of matrix that the adjustment solves, bands, sparse blocks and dense ones, and small helpers.
//! Nothing here refers to stones.

mod band;
mod block;
mod dense;
mod fused;
mod selected_inverse;
mod symmetric;
#[cfg(test)]
mod tests;

pub(crate) use band::{Band, BandFactor, BandInverse};
pub(crate) use block::{BlockFactor, BlockMatrix, BlockPattern};
pub(crate) use dense::DenseFactor;
pub(crate) use fused::{add_scaled, mul_add};
pub(crate) use selected_inverse::SelectedInverse;
pub(crate) use symmetric::root;
pub use symmetric::without_negative;
