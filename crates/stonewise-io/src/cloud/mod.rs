//! Point clouds of every usual format in, results out.

mod chunk;
mod colour_scale;
mod details;
mod e57_file;
mod error;
mod export;
mod extra_bytes;
mod format;
mod gathered;
mod guard;
mod info;
mod label;
mod labelled;
mod las;
mod lines;
mod ply;
mod points;
mod ptx;
mod read;
mod remark;
mod scalar;
mod scan;
mod spacing;
mod text;
mod whole;

pub use chunk::{PointChunk, ReadSummary};
pub use details::{CloudDetails, cloud_details};
pub use error::CloudError;
pub use extra_bytes::{Dimension, ExtraType};
pub use format::{CloudFormat, is_unread_cloud};
pub use gathered::{Clock, Created, FieldRange, Rounding, SourcePoints};
pub use info::{
    CloudInfo, claimed_records, cloud_crs, cloud_date, cloud_info, cloud_remarks, cloud_scans, measure_cloud,
};
pub use label::{LabelColumns, PointLabel, PointMotion};
pub use labelled::{select_points, write_labelled};
pub use ply::read_mesh;
pub use points::{
    ExtraColumn, Observed, PointSink, stream_coloured_laz, stream_points_laz, stream_scan_laz,
    write_points_laz,
};
pub use read::{read_cloud, read_first};
pub use remark::Remark;
pub use scan::Scan;
