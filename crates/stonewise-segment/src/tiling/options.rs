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
    /// Sizes at which the photo is looked at, 1 = as it is; see [`Self::scales_for`].
    pub scales: Vec<f64>,
    /// Pixels across (square root of the area) at which stones are found well. A size above 1 is looked at
    /// only where stones found at sizes up to 1 cover a tenth of a tile and a quarter of them would be
    /// smaller than this even there; a size below the largest up to 1 only where the stones that would be
    /// larger than this even there hold a quarter of the area found, or nothing was found.
    pub stone_px: f64,
    /// Masks with a lower score are dropped.
    pub min_score: f64,
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
            scales: vec![2.0, 1.0, 0.5, 0.25],
            stone_px: 60.0,
            min_score: 0.4,
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

    /// The sizes at which a photo of `width` x `height` pixels is looked at. A smaller size is for stones
    /// that no tile of the larger sizes shows whole, so it is left out where one tile of a larger size up to
    /// 1 shows the whole photo.
    pub fn scales_for(&self, width: u32, height: u32) -> Vec<f64> {
        let in_one_tile = |&scale: &f64| scaled(width.max(height), scale) <= self.tile_px;
        let is_needed = |scale: &f64| {
            !self
                .scales
                .iter()
                .any(|larger| larger > scale && *larger <= 1.0 && in_one_tile(larger))
        };
        self.scales.iter().copied().filter(is_needed).collect()
    }

    /// Number of tiles of a photo of this size, all scales together, whether or not the enlarged ones turn
    /// out to be needed.
    pub fn tile_count(&self, width: u32, height: u32) -> u64 {
        let count = |scale: f64| {
            let tiles = |size| origins(scaled(size, scale), self.tile_px, self.overlap_px).len() as u64;
            tiles(width) * tiles(height)
        };
        self.scales_for(width, height).into_iter().map(count).sum()
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
            (self.stone_px >= 0.0, "stone_px", "must not be negative"),
            (is_share(self.min_score), "min_score", "is a share, 0 to 1"),
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

#[cfg(test)]
mod tests {
    use super::TilingOptions;

    #[test]
    fn smaller_sizes_are_for_what_no_tile_shows_whole() {
        let options = TilingOptions::default();
        assert_eq!(options.scales_for(300, 500), [2.0, 1.0]);
        assert_eq!(options.scales_for(640, 641), [2.0, 1.0, 0.5]);
        assert_eq!(options.scales_for(1500, 1000), [2.0, 1.0, 0.5, 0.25]);
        let coarse = TilingOptions {
            scales: vec![0.25],
            ..options
        };
        assert_eq!(coarse.scales_for(300, 500), [0.25], "only what was set is kept");
    }
}
