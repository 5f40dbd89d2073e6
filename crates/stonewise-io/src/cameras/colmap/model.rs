//! COLMAP's camera models and their parameter orders (COLMAP documentation, "Camera Models").

use super::super::{CameraError, malformed};
use super::raw::RawCamera;
use std::path::Path;
use stonewise_core::geometry::{Camera, Distortion};

/// Models by their number in binary files, with their parameter count.
pub const MODELS: [(&str, usize); 12] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
];

/// Our camera for a listed one; `photo` is the first that uses it.
pub fn camera(raw: &RawCamera, photo: &str, path: &Path) -> Result<Camera, CameraError> {
    let p = raw.params.as_slice();
    let bad = |problem: String| Err(malformed(path, raw.place.clone(), problem));
    if let Some((name, count)) = MODELS.iter().find(|(name, _)| *name == raw.model)
        && *count != p.len()
    {
        return bad(format!("{name} has {count} parameters, found {}", p.len()));
    }

    let brown = |radial, rational, tangential| Distortion::brown(radial, rational, tangential);
    let fisheye = |radial| Distortion::fisheye(radial, [0.0; 2]);
    let (focal, center, distortion) = match (raw.model.as_str(), p) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f, f], [cx, cy], Distortion::None),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy], [cx, cy], Distortion::None),
        ("SIMPLE_RADIAL", &[f, cx, cy, k]) => {
            ([f, f], [cx, cy], brown([k, 0.0, 0.0, 0.0], [0.0; 3], [0.0; 2]))
        }
        ("RADIAL", &[f, cx, cy, k1, k2]) => ([f, f], [cx, cy], brown([k1, k2, 0.0, 0.0], [0.0; 3], [0.0; 2])),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => {
            ([fx, fy], [cx, cy], brown([k1, k2, 0.0, 0.0], [0.0; 3], [p1, p2]))
        }
        ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) => (
            [fx, fy],
            [cx, cy],
            brown([k1, k2, k3, 0.0], [k4, k5, k6], [p1, p2]),
        ),
        ("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4]) => {
            ([fx, fy], [cx, cy], fisheye([k1, k2, k3, k4]))
        }
        ("SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, k]) => ([f, f], [cx, cy], fisheye([k, 0.0, 0.0, 0.0])),
        ("RADIAL_FISHEYE", &[f, cx, cy, k1, k2]) => ([f, f], [cx, cy], fisheye([k1, k2, 0.0, 0.0])),
        _ => {
            return Err(CameraError::UnsupportedModel {
                path: path.to_owned(),
                model: raw.model.clone(),
                photo: photo.to_owned(),
            });
        }
    };

    let side = |value: u64| u32::try_from(value).ok().filter(|&v| v > 0);
    let (Some(width), Some(height)) = (side(raw.width), side(raw.height)) else {
        return bad(format!("impossible image size {}x{}", raw.width, raw.height));
    };
    if !p.iter().all(|v| v.is_finite()) || focal.iter().any(|&f| f <= 0.0) {
        return bad("parameters must be finite and focal lengths positive".to_owned());
    }

    Ok(Camera {
        width,
        height,
        focal_px: focal,
        center_px: center,
        skew_px: 0.0,
        distortion,
        near: None,
    })
}
