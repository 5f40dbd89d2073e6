//! One stone at a time with its surroundings, by plane-to-plane ICP: the estimator of the paper.
//!
//! Generalized ICP (Segal, Haehnel & Thrun 2009): every point stands for a small piece of plane, and the
//! rigid motion is sought that brings the pieces of the first epoch onto their nearest neighbours in the
//! second. The points of a stone alone are few, so all within a buffer around them take part; whatever stands
//! still there, or moves otherwise, drags the answer. [`GicpBlock::new`] prepares a region of each epoch once,
//! [`align`] measures the stones inside, [`relate_to_neighbours`] compares all stones in the end.

mod align;
mod block;
mod neighbours;
mod params;
mod uncertainty;
mod window;

pub use align::align;
pub use block::{GicpBlock, GicpStone};
pub use neighbours::relate_to_neighbours;
pub use params::GicpParams;

#[cfg(test)]
mod tests;
