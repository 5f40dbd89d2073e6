//! Images of anything: colours, depths, labels.

mod closing;
mod components;
mod contour;
mod polygon;
mod raster_type;
mod relief;
mod rle;
mod srgb;
mod sum_table;

pub use closing::closed;
pub use components::{Component, connected_components};
pub use contour::{Ring, label_outlines};
pub use polygon::fill_polygon;
pub use raster_type::{DepthMap, LabelImage, Raster, RgbImage};
pub use relief::{RELIEF_CHANNELS, RangeImage, ReliefMap};
pub use rle::{Rle, RleError};
pub use srgb::{linear_from_srgb, srgb_from_linear};
pub(crate) use sum_table::SumTable;
