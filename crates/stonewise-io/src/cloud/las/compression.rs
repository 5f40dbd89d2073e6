//! How the points of a file are compressed.

use laz::LazVlr;

use super::envelope::{Envelope, Records};
use super::las_error::las_error;
use crate::cloud::CloudError;

/// How points are compressed.
pub struct Compression {
    pub vlr: LazVlr,
    pub order: Order,
}

/// How compressed points are laid out.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// One point after the other, without chunks.
    Stream,
    /// Chunks of points, one after the other.
    Chunks,
    /// Chunks in which every attribute is a layer of its own.
    Layers,
}

impl Compression {
    /// How the points are compressed, where they are; an error where that is not said or does not fit them.
    pub fn of(envelope: &Envelope, records: &Records) -> Result<Option<Self>, CloudError> {
        if !envelope.is_compressed() {
            return Ok(None);
        }
        let path = &envelope.path;
        let data = records.laszip.as_ref().ok_or_else(|| {
            CloudError::malformed(
                path,
                "the points are compressed, but no record says how: write the file again",
            )
        })?;
        let vlr = LazVlr::from_buffer(data).map_err(|e| las_error(path, las::Error::from(e)))?;
        // Summed here, because the library's sum of 16 bits overflows on damaged sizes.
        let size: u64 = vlr.items().iter().map(|item| u64::from(item.size())).sum();
        if size != envelope.record_bytes() {
            let reason = "the compression record does not fit the point format";
            return Err(CloudError::malformed(path, reason));
        }
        let order = match data[..] {
            [1, 0, ..] => Order::Stream,
            [2, 0, ..] => Order::Chunks,
            _ => Order::Layers,
        };
        Ok(Some(Self { vlr, order }))
    }
}
