//! Point clouds of every usual format in, results out.

mod chunk;
mod coloured;
mod e57_file;
mod error;
mod export;
mod format;
mod guard;
mod info;
mod label;
mod las;
mod lines;
mod ply;
mod points;
mod read;
mod text;
mod whole;

pub use chunk::{PointChunk, ReadSummary};
pub use coloured::{ColouredPoints, write_coloured_laz};
pub use error::CloudError;
pub use format::CloudFormat;
pub use info::{CloudInfo, Scan, cloud_info};
pub use label::{LabelColumns, PointLabel, PointMotion, select_points, write_labelled};
pub use las::ExtraType;
pub use ply::read_mesh;
pub use points::{ExtraColumn, PointSink, stream_points_laz, write_points_laz};
pub use read::read_cloud;
