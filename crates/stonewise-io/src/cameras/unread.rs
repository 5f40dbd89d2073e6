//! Camera files that are recognised only to say what to give instead.

use crate::folder::extension;
use crate::text::read_head;
use std::path::Path;

/// A file says within so many bytes what it is.
const HEAD: u64 = 4096;

/// What to give instead of a camera file in a format that is not read; `None` for every other file.
pub fn unread_cameras(path: &Path) -> Option<&'static str> {
    let extension = extension(path);
    if !matches!(extension.as_str(), "json" | "out") {
        return None;
    }
    let head = read_head(path, HEAD).ok()?;
    match extension.as_str() {
        "out" if head.starts_with("# Bundle file") => {
            Some("Bundler files are not read: export the cameras as COLMAP, text or binary")
        }
        "json" if head.contains("\"sfm_data_version\"") => {
            Some("OpenMVG's sfm_data is not read: export the cameras as COLMAP (openMVG_main_openMVG2Colmap)")
        }
        "json" if head.contains("\"transform_matrix\"") => Some(
            "nerfstudio's transforms are not read: give the cameras that they were made from, such as COLMAP's \
             (colmap/sparse/0)",
        ),
        _ => None,
    }
}
