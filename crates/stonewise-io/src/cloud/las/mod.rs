//! LAS, LAZ and COPC.

mod copy;
mod export;
mod extra_bytes;
mod layout;
mod read;
mod writer;

pub(super) use copy::copy_labelled;
pub(super) use export::{Export, export_header, transforms_for, wkt_record};
pub use extra_bytes::ExtraType;
pub(super) use extra_bytes::{DESCRIPTOR_BYTES, describe};
pub(super) use layout::Layout;
pub(super) use read::read;
pub(super) use writer::LazWriter;
