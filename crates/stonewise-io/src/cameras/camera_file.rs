//! What a camera file holds.

use super::Remark;
use stonewise_core::geometry::View;

/// Pixels of the largest photo that is accepted.
pub(super) const MAX_PIXELS: u64 = 1 << 30;

/// What a camera file holds.
#[derive(Clone, Debug, Default)]
pub struct CameraFile {
    /// Posed photos, in the file's order.
    pub views: Vec<View>,
    /// Photos that cannot be used, with the reason: not aligned, disabled.
    pub skipped: Vec<(String, Remark)>,
    /// Coordinate reference system of the world frame as the file writes it, where it says.
    pub crs: Option<String>,
    /// Whether the file says that a camera has a rolling shutter.
    pub rolling_shutter: bool,
    /// How the file was read, where a reader of the results must be told.
    pub warnings: Vec<Remark>,
}
