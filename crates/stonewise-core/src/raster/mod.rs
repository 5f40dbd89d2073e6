//! Images of anything: colours, depths, labels.

mod components;
mod contour;
mod polygon;
mod raster_type;
mod rle;

pub use components::{Component, connected_components};
pub use contour::{Ring, label_outlines, ring_area};
pub use polygon::fill_polygon;
pub use raster_type::{DepthMap, LabelImage, Raster, RgbImage};
pub use rle::{Rle, RleError};
