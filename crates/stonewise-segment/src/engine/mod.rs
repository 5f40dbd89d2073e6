//! Tensors and their derivatives: what the detector is computed with.
//!
//! Operations on tensors that are on a [`Tape`] are recorded there, and the tape gives derivatives; all other
//! operations only compute. What depends on nothing that is on a tape therefore costs no backward pass.
//! Results do not depend on the number of threads.
//!
//! No framework is used: most of the time goes into kernels that stonewise needs anyway, and a framework brings many
//! crates and much compiler time (`lab/diary.md` compares them). Training on a GPU is left to torchvision, whose names
//! the weights have.

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
