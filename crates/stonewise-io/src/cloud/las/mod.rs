//! LAS, LAZ and COPC.

mod chunks;
mod compression;
mod copy;
mod crs_record;
mod details;
mod envelope;
mod export;
mod las_error;
mod layout;
mod read;
mod stream;
mod unpack;
mod writer;

pub(super) use copy::copy_labelled;
pub(super) use crs_record::crs_record;
pub(super) use details::details;
pub(super) use export::{Export, export_header, transforms_for};
pub(super) use layout::Layout;
pub(super) use read::read;
pub(super) use writer::LazWriter;
