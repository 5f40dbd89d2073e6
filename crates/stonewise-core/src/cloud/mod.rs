//! Point clouds and searching in them.

mod blocks;
mod candidates;
mod cell_moments;
mod cloud_type;
mod cylinder;
mod grid_index;
mod tiles;

pub(crate) use candidates::Candidates;
pub use cell_moments::CellMoments;
pub use cloud_type::Cloud;
pub use cylinder::Cylinder;
pub use grid_index::GridIndex;
pub(crate) use grid_index::sort_nearest;
pub use tiles::{MemoryTiles, TileSource};
