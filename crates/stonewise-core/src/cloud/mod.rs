//! Point clouds and searching in them.

mod cloud_type;
mod grid_index;

pub use cloud_type::Cloud;
pub use grid_index::GridIndex;
