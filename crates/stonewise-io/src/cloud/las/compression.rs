//! How the points of a file are compressed.

use laz::{LazItemType, LazVlr};

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

        // The decoder takes memory for layers that it has found no sizes of.
        if vlr
            .items()
            .iter()
            .any(|item| has_layers(item.item_type()) != (order == Order::Layers))
        {
            let reason =
                "the compression record mixes layers with points that have none: write the file again";
            return Err(CloudError::malformed(path, reason));
        }

        Ok(Some(Self { vlr, order }))
    }
}

/// Whether this part of a point is stored in layers: that of the point formats 6 to 10.
fn has_layers(kind: LazItemType) -> bool {
    !matches!(
        kind,
        LazItemType::Byte(_)
            | LazItemType::Point10
            | LazItemType::GpsTime
            | LazItemType::RGB12
            | LazItemType::WavePacket13
    )
}
