//! Camera models: from a direction in the camera frame to a pixel and back.
//!
//! Camera frame: x right, y down, z along the view. Pixel frame: x right, y down, first pixel centre (0.5, 0.5).

/// Interior orientation of a frame camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Focal lengths along x and y, pixels.
    pub focal_px: [f64; 2],
    /// Principal point, pixels.
    pub center_px: [f64; 2],
    /// Skew, pixels: how much a distorted unit of y adds to pixel x (Metashape's b2).
    pub skew_px: f64,
    /// Lens distortion, applied to normalised coordinates.
    pub distortion: Distortion,
}

/// Lens distortion of normalised coordinates (x, y) = (X/Z, Y/Z).
#[derive(Clone, Debug, PartialEq)]
pub enum Distortion {
    /// A pinhole.
    None,
}
