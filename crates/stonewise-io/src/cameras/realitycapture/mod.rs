//! Cameras of RealityCapture and RealityScan.
//!
//! A camera sees R (X - C), y down and z along the view; lengths in the photo are in units of its longer side,
//! places count from its middle, and focal lengths are given for 36 of these units (RealityScan, "On the
//! coordinate systems employed in the import, estimation, and export of camera geometry", sections 3 and 4).

mod csv;
mod lens;
mod xmp;

pub use csv::{is_csv, read_csv};
pub use xmp::{is_sidecar_folder, read_sidecars};
