//! Point clouds and searching in them.

mod cloud_type;
mod grid_index;
mod tiles;

pub use cloud_type::Cloud;
pub use grid_index::GridIndex;
pub use tiles::{MemoryTiles, TileSource};
