//! PCD files of the Point Cloud Library.

mod header;
mod lzf;
mod read;

pub(super) use read::{point_count, read, scans};
