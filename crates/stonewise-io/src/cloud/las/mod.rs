//! LAS, LAZ and COPC.

mod layout;
mod read;

pub(super) use layout::Layout;
pub(super) use read::{LasSource, read};
