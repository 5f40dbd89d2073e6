//! Which part of a photo a training image shows, and from where.

use super::params::AugmentParams;
use super::photo::Photo;
use crate::Sample;
use nalgebra::{Matrix3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use stonewise_core::raster::{RELIEF_CHANNELS, Raster, ReliefMap};

/// A projective map from a square crop to a photo.
#[derive(Clone, Debug)]
pub struct CropView {
    photo_from_crop: Matrix3<f64>,
    /// Crop pixels in a photo pixel, on the average.
    scale: f64,
    size_px: u32,
}

impl CropView {
    /// An upright square of the photo.
    pub fn straight(corner: [f64; 2], side: f64, size_px: u32) -> Self {
        let at = |x: f64, y: f64| [corner[0] + side * x, corner[1] + side * y];
        Self::of_corners(
            [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)],
            side,
            size_px,
        )
    }

    /// A square around a place, turned, mirrored and seen obliquely by chance, in which a stone of typical
    /// size has one of the sizes of `params.stone_px`, small sizes as often as large ones.
    pub fn random(
        photo: &Photo,
        centre: [f64; 2],
        size_px: u32,
        params: &AugmentParams,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        let between = |rng: &mut ChaCha8Rng, low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let [least, most] = params.stone_px.map(f64::ln);
        let scale = between(rng, least, most).exp() / photo.stone_px();
        let side = f64::from(size_px) / scale;
        let angle = between(rng, -1.0, 1.0) * params.rotation_deg.to_radians();
        let (sin, cos) = angle.sin_cos();
        let mirror = if rng.random::<f64>() < params.mirrored_share {
            -1.0
        } else {
            1.0
        };
        let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[x, y]: [f64; 2]| {
            let mut shift = || between(rng, -1.0, 1.0) * params.perspective;
            let (x, y) = (side * mirror * (x + shift()), side * (y + shift()));
            [centre[0] + cos * x - sin * y, centre[1] + sin * x + cos * y]
        });
        Self::of_corners(corners, side, size_px)
    }

    /// The map of the crop's corners, clockwise from its first pixel, to these places. Source: Heckbert 1989,
    /// section 2.2.3.
    fn of_corners([p0, p1, p2, p3]: [[f64; 2]; 4], side: f64, size_px: u32) -> Self {
        let difference = |a: [f64; 2], b: [f64; 2]| [a[0] - b[0], a[1] - b[1]];
        let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
        let (d1, d2) = (difference(p1, p2), difference(p3, p2));
        let sum = [0, 1].map(|i| p0[i] - p1[i] + p2[i] - p3[i]);
        let (g, h) = (cross(sum, d2) / cross(d1, d2), cross(d1, sum) / cross(d1, d2));
        let row = |i: usize| [p1[i] - p0[i] + g * p1[i], p3[i] - p0[i] + h * p3[i], p0[i]];
        let (x, y) = (row(0), row(1));
        let unit = 1.0 / f64::from(size_px);
        Self {
            photo_from_crop: Matrix3::new(x[0], x[1], x[2], y[0], y[1], y[2], g, h, 1.0)
                * Matrix3::from_diagonal(&Vector3::new(unit, unit, 1.0)),
            scale: f64::from(size_px) / side,
            size_px,
        }
    }

    /// The place of the photo that a place of the crop shows.
    pub fn to_photo(&self, at: [f64; 2]) -> [f64; 2] {
        let p = self.photo_from_crop * Vector3::new(at[0], at[1], 1.0);
        [p.x / p.z, p.y / p.z]
    }

    /// The crop, image, labels and relief alike: heights, slope and confidence do not depend on the direction
    /// from which they are seen.
    pub fn cut(&self, photo: &Photo) -> Sample {
        let relief = photo
            .sample()
            .relief()
            .map(|relief| self.cut_relief(photo, relief));
        let crop = Sample::from_pixels(self.size_px, self.size_px, |index| {
            let (x, y) = (index as u32 % self.size_px, index as u32 / self.size_px);
            let at = self.to_photo([f64::from(x) + 0.5, f64::from(y) + 0.5]);
            let (label, ignored) = photo.label(at);
            (photo.colour(at, self.scale), label, ignored)
        });
        crop.with_relief(relief)
    }

    /// The relief of the crop's pixels; outside the photo nothing is known of it.
    fn cut_relief(&self, photo: &Photo, relief: &ReliefMap) -> ReliefMap {
        let image = photo.sample().image();
        let cells = [
            f64::from(relief.width()) / f64::from(image.width()),
            f64::from(relief.height()) / f64::from(image.height()),
        ];
        let mut cut = Raster::filled(self.size_px, self.size_px, [0.0; RELIEF_CHANNELS]);
        for (index, value) in cut.data_mut().iter_mut().enumerate() {
            let (x, y) = (index as u32 % self.size_px, index as u32 / self.size_px);
            let at = self.to_photo([f64::from(x) + 0.5, f64::from(y) + 0.5]);
            *value = relief
                .at([at[0] * cells[0], at[1] * cells[1]])
                .copied()
                .unwrap_or_default();
        }
        cut
    }
}
