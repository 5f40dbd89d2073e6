//! Stanford PLY files.

mod header;
mod read;

pub(super) use read::read;
