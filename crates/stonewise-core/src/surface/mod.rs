//! The surface that a cloud shows, in cells of a few decimetres: where it is, how it lies, which side is
//! outside.
//!
//! Normals of a cloud have no sign. [`oriented_surface`] gives all cells consistent signs and then decides which side is
//! outside: by the positions of scanners where they are known, else by what masonry and its surroundings look
//! like from outside.

mod cells;
mod orient;
mod outside;
mod signs;

pub use cells::{SurfaceCell, surface_cells};
pub use orient::{Evidence, Orientation, SURE_OF_OUTSIDE, orient, oriented_surface};
pub use outside::Outside;
