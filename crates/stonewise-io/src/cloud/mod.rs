//! Point clouds of every usual format in, results out.

mod chunk;
mod error;
mod format;
mod guard;
mod info;
mod las;
mod read;

pub use chunk::{PointChunk, ReadSummary};
pub use error::CloudError;
pub use format::CloudFormat;
pub use info::{CloudInfo, Scan, cloud_info};
pub use read::read_cloud;
