//! Parameters of looking at photos in tiles.

use super::grid::origins;
use serde::{Deserialize, Serialize};
use stonewise_core::raster::RgbImage;

/// How a photo is cut into tiles, and what becomes of the masks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TilingOptions {
    /// Edge of a tile, pixels of its scale.
    pub tile_px: u32,
    /// Least overlap of two tiles, pixels of their scale. A stone up to this size is whole in one of them.
    pub overlap_px: u32,
    /// Sizes at which the photo is looked at, 1 = as it is.
    pub scales: Vec<f64>,
    /// Masks with a lower score are dropped.
    pub min_score: f32,
    /// Stones with fewer pixels of the photo are dropped.
    pub min_area_px: u32,
    /// Share of a mask that must not lie on better ones.
    pub min_new_share: f64,
}

impl Default for TilingOptions {
    fn default() -> Self {
        Self {
            tile_px: 640,
            overlap_px: 160,
            scales: vec![1.0, 0.5, 0.25],
            min_score: 0.5,
            min_area_px: 40,
            min_new_share: 0.6,
        }
    }
}

impl TilingOptions {
    /// Looks at an image in one piece, as it is.
    pub fn whole(image: &RgbImage) -> Self {
        Self {
            tile_px: image.width().max(image.height()),
            scales: vec![1.0],
            ..Self::default()
        }
    }

    /// Number of tiles of a photo of this size, all scales together.
    pub fn tile_count(&self, width: u32, height: u32) -> u64 {
        let count = |&scale: &f64| {
            let tiles = |size| origins(scaled(size, scale), self.tile_px, self.overlap_px).len() as u64;
            tiles(width) * tiles(height)
        };
        self.scales.iter().map(count).sum()
    }

    /// The first key whose value cannot be, and what it must be.
    pub fn impossible(&self) -> Option<(&'static str, &'static str)> {
        let is_share = |v: f64| (0.0..=1.0).contains(&v);
        let checks = [
            (self.tile_px >= 64, "tile_px", "must be at least 64"),
            (
                2 * self.overlap_px <= self.tile_px,
                "overlap_px",
                "must be at most half of tile_px",
            ),
            (
                !self.scales.is_empty() && self.scales.iter().all(|s| (0.01..=4.0).contains(s)),
                "scales",
                "must be one or more numbers from 0.01 to 4",
            ),
            (
                is_share(f64::from(self.min_score)),
                "min_score",
                "is a share, 0 to 1",
            ),
            (
                is_share(self.min_new_share),
                "min_new_share",
                "is a share, 0 to 1",
            ),
        ];
        let wrong = checks.into_iter().find(|check| !check.0);
        wrong.map(|(_, key, what)| (key, what))
    }
}

/// A length at another scale, pixels, at least 1.
pub(super) fn scaled(size: u32, scale: f64) -> u32 {
    ((f64::from(size) * scale).round() as u32).max(1)
}
