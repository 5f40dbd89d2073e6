//! Decoders of whole points.

use std::io::{Read, Seek};

use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{LazItem, LazItemType};

use super::gps_time::GpsTimeItem;
use super::point_item::PointItem;
use crate::cloud::las::compression::{Compression, Order};

/// The decoder of the points of a chunk.
pub type Decoder<R> = Box<dyn RecordDecompressor<R> + Send>;

/// The laz library's decoder, except for the items with GPS times, which are decoded here.
pub fn decoder<R: Read + Seek + Send + 'static>(
    compression: &Compression,
    source: R,
) -> Result<Decoder<R>, las::Error> {
    let items = compression.vlr.items();
    if compression.order == Order::Layers {
        let mut decoder = LayeredPointRecordDecompressor::new(source);
        for item in items {
            match (item.item_type(), item.version()) {
                (LazItemType::Point14, version @ 3..=4) => {
                    decoder.add_field_decompressor(PointItem::new(version));
                }
                _ => add_others(&mut decoder, item)?,
            }
        }
        return Ok(Box::new(decoder));
    }
    let mut decoder = SequentialPointRecordDecompressor::new(source);
    for item in items {
        match (item.item_type(), item.version()) {
            (LazItemType::GpsTime, 2) => decoder.add_field_decompressor(GpsTimeItem::new()),
            _ => add_others(&mut decoder, item)?,
        }
    }
    Ok(Box::new(decoder))
}

fn add_others<R>(decoder: &mut impl RecordDecompressor<R>, item: &LazItem) -> Result<(), las::Error> {
    decoder.set_fields_from(&vec![*item]).map_err(las::Error::from)
}
