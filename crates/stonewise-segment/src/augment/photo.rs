//! A labelled photo, ready to be cut up at any scale.

use crate::Sample;
use crate::tiling::at_scale;
use stonewise_core::raster::{RgbImage, connected_components};
use stonewise_core::statistics::upper_median;

/// Smaller images of a photo are made down to this length of the shorter side.
const LEAST_SIDE_PX: u32 = 64;

/// A labelled photo with its smaller images, each half the size of the one before. Memory: about nine bytes a
/// pixel.
#[derive(Clone, Debug)]
pub struct Photo {
    sample: Sample,
    smaller: Vec<RgbImage>,
    stone_px: f64,
}

impl Photo {
    /// Prepares a photo.
    pub fn new(sample: Sample) -> Self {
        let mut smaller: Vec<RgbImage> = Vec::new();
        loop {
            let last = smaller.last().unwrap_or(sample.image());
            if last.width().min(last.height()) < 2 * LEAST_SIDE_PX {
                break;
            }
            smaller.push(at_scale(last, 0.5));
        }
        Self {
            stone_px: typical_size(&sample),
            sample,
            smaller,
        }
    }

    /// The photo with its labels.
    pub fn sample(&self) -> &Sample {
        &self.sample
    }

    /// Square root of the median area of its stones, pixels; the photo's shorter side where it has none.
    pub fn stone_px(&self) -> f64 {
        self.stone_px
    }

    /// The image whose pixels are no larger than a crop's at this scale (crop pixels in a photo pixel), and
    /// at least half as large.
    fn level(&self, scale: f64) -> &RgbImage {
        let halvings = (1.0 / scale).log2().floor().max(0.0) as usize;
        match halvings.min(self.smaller.len()) {
            0 => self.sample.image(),
            n => &self.smaller[n - 1],
        }
    }

    /// The colour at a place of the photo, interpolated in the image for this scale; places outside have that
    /// of the border.
    pub fn colour(&self, at: [f64; 2], scale: f64) -> [u8; 3] {
        let image = self.level(scale);
        let size = [image.width(), image.height()].map(f64::from);
        let whole = [self.sample.image().width(), self.sample.image().height()].map(f64::from);
        let [u, v] = [0, 1].map(|i| (at[i] * size[i] / whole[i] - 0.5).clamp(0.0, size[i] - 1.0));
        let (x, y) = (u.floor(), v.floor());
        let pixel = |dx: u32, dy: u32| {
            let (x, y) = (
                (x as u32 + dx).min(image.width() - 1),
                (y as u32 + dy).min(image.height() - 1),
            );
            image.get(x, y).copied().unwrap_or_default()
        };
        let (a, b) = (u - x, v - y);
        let corners = [pixel(0, 0), pixel(1, 0), pixel(0, 1), pixel(1, 1)];
        let weights = [(1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b];
        [0, 1, 2].map(|c| {
            let sum: f64 = corners
                .iter()
                .zip(weights)
                .map(|(p, w)| f64::from(p[c]) * w)
                .sum();
            sum.round() as u8
        })
    }

    /// The stone at a place of the photo, and whether nothing is known there; nothing is known outside.
    pub fn label(&self, at: [f64; 2]) -> (u32, bool) {
        match (self.sample.labels().at(at), self.sample.ignore().at(at)) {
            (Some(&label), Some(&ignored)) => (label, ignored),
            _ => (0, true),
        }
    }
}

fn typical_size(sample: &Sample) -> f64 {
    let (_, parts) = connected_components(sample.labels());
    let mut areas: Vec<f64> = parts.iter().map(|p| f64::from(p.area)).collect();
    match upper_median(&mut areas) {
        Some(area) => area.sqrt(),
        None => f64::from(sample.image().width().min(sample.image().height())),
    }
}
