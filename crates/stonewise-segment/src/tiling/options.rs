//! Parameters of looking at photos in tiles.

use super::grid::origins;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use stonewise_core::params::{ParamError, Params, Range, Ranged, with_ranges};
use stonewise_core::raster::RgbImage;

/// How a photo is cut into tiles, and what becomes of the masks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct TilingOptions {
    /// Edge of a tile, pixels of its scale.
    pub tile_px: u32,
    /// Least overlap of two tiles, pixels of their scale. A stone up to this size is whole in one of them.
    pub overlap_px: u32,
    /// Sizes at which the photo is looked at, 1 = as it is; a smaller one is left out where one tile of a
    /// larger one shows the whole photo. Four: stones from 10 to 500 pixels.
    pub scales: Vec<f64>,
    /// Pixels across (square root of the area) at which stones are found well. A size above 1 is looked at
    /// only where stones found at sizes up to 1 cover a tenth of a tile and a quarter of them would be
    /// smaller than this even there; a size below the largest up to 1 only where the stones that would be
    /// larger than this even there hold a quarter of the area found, or nothing was found.
    pub stone_px: f64,
    /// Masks with a lower score are dropped. 0.4: on rendered walls, F1 of the built-in weights is higher than
    /// at 0.5 and not distinguishable from that at 0.3.
    pub min_score: f64,
    /// Stones with fewer pixels of the photo are dropped. 40: smaller ones have too few points to be measured.
    pub min_area_px: u32,
    /// Share of a mask's pixels that masks with higher scores must leave free. 0.6: below it, a mask shows the
    /// same stone again, a part of it or a group.
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

impl Params for TilingOptions {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::between(64.0, f64::INFINITY).holds("tile_px", self.tile_px),
            Range::NOT_NEGATIVE.holds("overlap_px", self.overlap_px),
            Range::between(0.01, 4.0).holds("scales", self.scales.as_slice()),
            Range::NOT_NEGATIVE.holds("stone_px", self.stone_px),
            Range::SHARE.holds("min_score", self.min_score),
            Range::NOT_NEGATIVE.holds("min_area_px", self.min_area_px),
            Range::SHARE.holds("min_new_share", self.min_new_share),
        ]
    }

    fn check_relations(&self) -> Result<(), ParamError> {
        if u64::from(self.overlap_px) * 2 > u64::from(self.tile_px) {
            return Err(ParamError::new(
                "overlap_px",
                self.overlap_px,
                "at most half of tile_px",
            ));
        }
        if self.scales.is_empty() {
            return Err(ParamError::new("scales", "[]", "one number or more"));
        }
        Ok(())
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

    /// The sizes at which a photo of `width` x `height` pixels is looked at if its stones have the right size
    /// at `base`: each of [`scales`](Self::scales) times `base`. A smaller size is for stones that no tile of
    /// the larger sizes shows whole, so it is left out where one tile of a larger size up to `base` shows the
    /// whole photo.
    pub fn scales_for(&self, width: u32, height: u32, base: f64) -> Vec<f64> {
        let in_one_tile = |&scale: &f64| scaled(width.max(height), scale * base) <= self.tile_px;
        let is_needed = |scale: &f64| {
            !self
                .scales
                .iter()
                .any(|larger| larger > scale && *larger <= 1.0 && in_one_tile(larger))
        };
        let needed = self.scales.iter().copied().filter(is_needed);
        needed.map(|scale| scale * base).collect()
    }

    /// Number of tiles of a photo of this size, all scales together, whether or not those above `base` turn
    /// out to be needed.
    pub fn tile_count(&self, width: u32, height: u32, base: f64) -> u64 {
        let count = |scale: f64| {
            let tiles = |size| origins(scaled(size, scale), self.tile_px, self.overlap_px).len() as u64;
            tiles(width) * tiles(height)
        };
        self.scales_for(width, height, base).into_iter().map(count).sum()
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
        assert_eq!(options.scales_for(300, 500, 1.0), [2.0, 1.0]);
        assert_eq!(options.scales_for(640, 641, 1.0), [2.0, 1.0, 0.5]);
        assert_eq!(options.scales_for(1500, 1000, 1.0), [2.0, 1.0, 0.5, 0.25]);
        assert_eq!(options.scales_for(1500, 1000, 0.5), [1.0, 0.5, 0.25]);
        assert_eq!(options.scales_for(1500, 1000, 0.4), [0.8, 0.4]);
        let coarse = TilingOptions {
            scales: vec![0.25],
            ..options
        };
        assert_eq!(
            coarse.scales_for(300, 500, 1.0),
            [0.25],
            "only what was set is kept"
        );
    }
}
