//! Images of anything: colours, depths, labels.

mod raster_type;

pub use raster_type::{DepthMap, LabelImage, Raster};
