//! Point clouds of every usual format in, results out.

mod chunk;
mod coloured;
mod e57_file;
mod error;
mod export;
mod extra_bytes;
mod format;
mod guard;
mod info;
mod label;
mod labelled;
mod las;
mod lines;
mod ply;
mod points;
mod read;
mod scan;
mod text;
mod whole;

pub use chunk::{PointChunk, ReadSummary};
pub use coloured::{ColouredPoints, write_coloured_laz};
pub use error::CloudError;
pub use extra_bytes::{Dimension, ExtraType};
pub use format::CloudFormat;
pub use info::{CloudInfo, claimed_records, cloud_crs, cloud_info, measure_cloud};
pub use label::{LabelColumns, PointLabel, PointMotion};
pub use labelled::{select_points, write_labelled};
pub use ply::read_mesh;
pub use points::{ExtraColumn, Observed, PointSink, stream_points_laz, stream_scan_laz, write_points_laz};
pub use read::read_cloud;
pub use scan::Scan;
