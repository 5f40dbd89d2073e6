//! Cameras and images as a COLMAP model lists them.

/// A line of the camera list.
pub(super) struct RawCamera {
    pub model: String,
    pub width: u64,
    pub height: u64,
    pub params: Vec<f64>,
    /// Where in the file, for messages.
    pub place: String,
}

/// A line of the image list.
pub(super) struct RawImage {
    pub rotation_wxyz: [f64; 4],
    pub translation: [f64; 3],
    pub camera_id: u32,
    pub name: String,
    pub place: String,
}
