//! Stanford PLY files.

mod header;
mod mesh;
mod read;

pub use mesh::read_mesh;
pub(super) use read::{read, vertex_count};
