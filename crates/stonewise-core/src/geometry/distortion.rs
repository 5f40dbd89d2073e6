//! Lens distortion: from the direction of a ray to where the lens puts it, and back.
//!
//! Coordinates are normalised: (x, y) = (X/Z, Y/Z) of a point in the camera frame, before the focal length is
//! applied.

use super::brown::Brown;

/// Lens distortion of normalised coordinates.
#[derive(Clone, Debug, PartialEq)]
pub enum Distortion {
    /// A pinhole.
    None,
    /// Radial, rational and tangential terms of a frame lens.
    Brown(Brown),
    /// An equidistant fisheye whose angle then goes through Brown's terms.
    ///
    /// With zero tangential terms this is the model of Kannala & Brandt (2006) as OpenCV's fisheye module and
    /// COLMAP's OPENCV_FISHEYE use it; with them it is Metashape's fisheye. Rays at 90 degrees and more are
    /// not covered.
    Fisheye(Brown),
}

impl Distortion {
    /// A frame lens with the terms of [`Brown::new`]; all zero gives [`Distortion::None`].
    pub fn brown(radial: [f64; 4], rational: [f64; 3], tangential: [f64; 2]) -> Self {
        let is_zero = |values: &[f64]| values.iter().all(|&v| v == 0.0);
        if is_zero(&radial) && is_zero(&rational) && is_zero(&tangential) {
            Self::None
        } else {
            Self::Brown(Brown::new(radial, rational, tangential, MAX_FRAME_RADIUS))
        }
    }

    /// A fisheye: theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8), tangential terms
    /// (p1, p2) in OpenCV's order.
    pub fn fisheye(radial: [f64; 4], tangential: [f64; 2]) -> Self {
        Self::Fisheye(Brown::new(radial, [0.0; 3], tangential, MAX_FISHEYE_ANGLE))
    }

    /// The distorted place of an undistorted one; `None` outside the range where the model can be inverted.
    #[inline]
    pub fn distort(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        match self {
            Self::None => Some([x, y]),
            Self::Brown(brown) => brown.distort([x, y]),
            Self::Fisheye(brown) => {
                let r = (x * x + y * y).sqrt();
                let scale = if r > 1e-9 { r.atan() / r } else { 1.0 };
                brown.distort([x * scale, y * scale])
            }
        }
    }

    /// The undistorted place of a distorted one, to 1e-12; `None` where the lens shows nothing there.
    pub fn undistort(&self, [xd, yd]: [f64; 2]) -> Option<[f64; 2]> {
        match self {
            Self::None => Some([xd, yd]),
            Self::Brown(brown) => brown.undistort([xd, yd]),
            Self::Fisheye(brown) => {
                let [x, y] = brown.undistort([xd, yd])?;
                let theta = x.hypot(y);
                let scale = if theta > 1e-9 { theta.tan() / theta } else { 1.0 };
                (theta < MAX_FISHEYE_ANGLE).then_some([x * scale, y * scale])
            }
        }
    }
}

/// Radius at which the search for the end of a frame lens's range stops: 88.6 degrees off axis.
const MAX_FRAME_RADIUS: f64 = 40.0;
/// Just under 90 degrees: beyond it a point has no X/Z.
const MAX_FISHEYE_ANGLE: f64 = 1.57;
