//! Lenses of RealityCapture.

use super::super::CameraError;
use std::path::Path;
use stonewise_core::geometry::{Camera, Distortion};

/// Millimetres of film along the longer side of a photo.
pub const FILM_MM: f64 = 36.0;

/// A lens in units of the longer side of the photo.
#[derive(Debug, Default)]
pub struct Lens {
    pub focal: f64,
    /// Principal point from the middle of the photo.
    pub centre: [f64; 2],
    /// k1 to k4, t1, t2.
    pub terms: [f64; 6],
}

impl Lens {
    /// The camera of a photo of this size.
    pub fn camera(&self, [width, height]: [u32; 2]) -> Camera {
        let unit = f64::from(width.max(height));
        let [k1, k2, k3, k4, t1, t2] = self.terms;
        Camera {
            width,
            height,
            focal_px: [self.focal * unit; 2],
            center_px: [
                self.centre[0] * unit + f64::from(width) / 2.0,
                self.centre[1] * unit + f64::from(height) / 2.0,
            ],
            skew_px: 0.0,
            // The order of the tangential terms is the reverse of OpenCV's.
            distortion: Distortion::brown([k1, k2, k3, k4], [0.0; 3], [t2, t1]),
            near: None,
        }
    }

    /// Whether only the first term is there, as the division model has it.
    pub fn has_one_term(&self) -> bool {
        self.terms[0] != 0.0 && self.terms[1..].iter().all(|term| *term == 0.0)
    }
}

/// Says that a lens model is not supported.
pub fn unsupported(path: &Path, model: &str, photo: &str) -> CameraError {
    CameraError::UnsupportedModel {
        path: path.to_owned(),
        model: model.to_owned(),
        photo: photo.to_owned(),
    }
}
