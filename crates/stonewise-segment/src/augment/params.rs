//! How training images vary.

use serde::{Deserialize, Serialize};

/// How much training images vary. Shares are chances, the other values the ends of ranges around no change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AugmentParams {
    /// Smallest and largest size at which a stone of typical size is shown, pixels: those at which the
    /// detector is used.
    pub stone_px: [f64; 2],
    /// Turn, degrees: photos are held about upright.
    pub rotation_deg: f64,
    /// Shift of each corner in parts of the side: oblique views.
    pub perspective: f64,
    /// Share of mirrored images.
    pub mirrored_share: f64,
    /// Change of brightness, in powers of two.
    pub brightness: f64,
    /// Change of contrast, in powers of two.
    pub contrast: f64,
    /// Change of the strength of colours, in powers of two.
    pub saturation: f64,
    /// Turn of the colour circle, degrees.
    pub hue_deg: f64,
    /// Change of each channel, in powers of two: the colour of the light.
    pub white_balance: f64,
    /// Share of blurred images.
    pub blurred_share: f64,
    /// Largest standard deviation of the blur, pixels.
    pub blur_px: f64,
    /// Largest standard deviation of the noise, in parts of full scale.
    pub noise: f64,
    /// Share of images across which a shadow falls.
    pub shadow_share: f64,
    /// Share of images that are compressed as JPEG.
    pub jpeg_share: f64,
}

impl Default for AugmentParams {
    fn default() -> Self {
        Self {
            stone_px: [20.0, 130.0],
            rotation_deg: 8.0,
            perspective: 0.12,
            mirrored_share: 0.5,
            brightness: 0.5,
            contrast: 0.4,
            saturation: 0.5,
            hue_deg: 8.0,
            white_balance: 0.15,
            blurred_share: 0.3,
            blur_px: 1.2,
            noise: 0.03,
            shadow_share: 0.3,
            jpeg_share: 0.3,
        }
    }
}
