//! Tensors and their derivatives: what the detector is computed with.
//!
//! Operations on tensors that are on a [`Tape`] are recorded there, and the tape gives derivatives; all other
//! operations only compute. What depends on nothing that is on a tape therefore costs no backward pass.
//! Results do not depend on the number of threads.

mod kernels;
mod movement;
mod pointwise;
mod sparse;
mod tape;
mod tensor;
mod weighted;

#[cfg(test)]
pub mod testing;

pub use kernels::Filters;
pub use sparse::SparseMatrix;
pub use tape::Tape;
pub use tensor::Tensor;
