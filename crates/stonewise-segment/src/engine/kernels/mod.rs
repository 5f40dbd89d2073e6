//! The operations that take the time, and their derivatives, on slices.

pub mod convolution;
pub mod depthwise;
pub mod exchange;
mod filters;
pub mod group_norm;
pub mod pool;
pub mod product;
mod same_padding;
pub mod sparse_product;
pub mod winograd;

pub use filters::Filters;
