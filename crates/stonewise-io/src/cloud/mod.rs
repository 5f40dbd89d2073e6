//! Point clouds of every usual format in, results out.

mod chunk;
mod error;
mod format;
mod guard;
mod info;
mod label;
mod las;
mod points;
mod read;
mod whole;

pub use chunk::{PointChunk, ReadSummary};
pub use error::CloudError;
pub use format::CloudFormat;
pub use info::{CloudInfo, Scan, cloud_info};
pub use label::{LabelColumns, PointLabel, PointMotion, write_labelled};
pub use points::{ExtraColumn, write_points_laz};
pub use read::read_cloud;
