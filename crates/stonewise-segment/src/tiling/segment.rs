//! A photo, tile by tile.

use super::candidate::{Candidate, Scaling, candidate};
use super::grid::{Rect, tiles};
use super::merge::merge;
use super::options::TilingOptions;
use super::pyramid::{at_scale, crop};
use crate::relief::resampled;
use crate::{Detector, Segmentation};
use std::cmp::Ordering;
use stonewise_core::parallel::{in_parallel, on_one_thread};
use stonewise_core::progress::{Interrupted, Progress};
use stonewise_core::raster::{ReliefMap, RgbImage};

/// Why a photo could not be segmented.
#[derive(Debug, thiserror::Error)]
pub enum TilingError<E> {
    /// The detector could not run.
    #[error(transparent)]
    Detector(E),
    /// The caller stopped it.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// The stones of a photo of any size. `relief`: what a cloud says about its surface, at any resolution;
/// `None` without a cloud.
///
/// The photo is looked at reduced to the scale `base` first, 1 = as it is; where its stones are too small or
/// too large for the detector, also enlarged or reduced from there ([`TilingOptions::stone_px`]). `progress`
/// advances by one for every tile, [`TilingOptions::tile_count`] in all. Memory: the photo once more at each scale in turn, a tile a thread
/// in the detector, and the masks found. The result does not depend on the number of threads if the
/// detector's does not.
///
/// # Errors
/// The detector could not run, or the caller stopped it.
pub fn segment_photo<D: Detector>(
    detector: &D,
    photo: &RgbImage,
    base: f64,
    relief: Option<&ReliefMap>,
    options: &TilingOptions,
    progress: &dyn Progress,
) -> Result<Segmentation, TilingError<D::Error>> {
    let scales = options.scales_for(photo.width(), photo.height(), base);
    // The largest size up to the base is looked at everywhere; what it shows says where others are needed.
    let rank = |&i: &usize| (scales[i] > base, -scales[i]);
    let mut order: Vec<usize> = (0..scales.len()).collect();
    order.sort_by(|a, b| rank(a).partial_cmp(&rank(b)).unwrap_or(Ordering::Equal));
    let mut candidates: Vec<Candidate> = Vec::new();

    for (place, &index) in order.iter().enumerate() {
        let size = Size::of(photo, &scales, index);
        let limit = options.stone_px / scales[index];
        let is_reduced = place > 0 && scales[index] <= base;
        // Stones up to the overlap are whole in a tile of the next larger size, which shows them better.
        let least = if is_reduced {
            f64::from(options.overlap_px) / scales[order[place - 1]]
        } else {
            0.0
        };
        let seen = Seen::of(&candidates);
        let is_needed = |tile: &Rect| {
            let part = size.scaling.rect(tile);
            match (place, scales[index] > base) {
                (0, _) => true,
                (_, true) => seen.has_small(&part, limit),
                (_, false) => seen.has_large(&part, limit),
            }
        };
        let (needed, others): (Vec<Rect>, Vec<Rect>) = size.tiles(options).into_iter().partition(is_needed);
        progress.advance(others.len() as u64);
        let found = size.look(detector, relief, &needed, options, progress)?;
        candidates.extend(found.into_iter().filter(|c| longer_side(c) >= least));
    }

    Ok(merge(candidates, photo.width(), photo.height(), options))
}

/// A photo at one size.
pub(super) struct Size {
    pub image: RgbImage,
    pub scaling: Scaling,
}

impl Size {
    pub fn of(photo: &RgbImage, scales: &[f64], index: usize) -> Self {
        let image = at_scale(photo, scales[index]);
        let scaling = Scaling {
            index,
            photo: [photo.width(), photo.height()],
            scaled: [image.width(), image.height()],
        };
        Self { image, scaling }
    }

    fn tiles(&self, options: &TilingOptions) -> Vec<Rect> {
        tiles(
            self.image.width(),
            self.image.height(),
            options.tile_px,
            options.overlap_px,
        )
    }

    /// The relief of a tile.
    pub fn relief(&self, relief: &ReliefMap, tile: &Rect) -> ReliefMap {
        let [width, height] = self.scaling.scaled.map(f64::from);
        let part = [
            f64::from(tile.left) / width,
            f64::from(tile.top) / height,
            f64::from(tile.width) / width,
            f64::from(tile.height) / height,
        ];
        resampled(relief, part, [tile.width, tile.height])
    }

    /// What the detector finds in some tiles, in their order. Tiles side by side take half of the time of
    /// threads in a layer.
    fn look<D: Detector>(
        &self,
        detector: &D,
        relief: Option<&ReliefMap>,
        tiles: &[Rect],
        options: &TilingOptions,
        progress: &dyn Progress,
    ) -> Result<Vec<Candidate>, TilingError<D::Error>> {
        let in_tile = |tile: &Rect| -> Result<Vec<Candidate>, TilingError<D::Error>> {
            progress.check()?;
            let relief = relief.map(|relief| self.relief(relief, tile));
            let found = detector
                .detect(&crop(&self.image, tile), relief.as_ref())
                .map_err(TilingError::Detector)?;
            progress.advance(1);
            let good = found.iter().filter(|d| f64::from(d.score) >= options.min_score);
            Ok(good.filter_map(|d| candidate(d, tile, &self.scaling)).collect())
        };
        let found = match tiles {
            [one] => vec![in_tile(one)?],
            _ => in_parallel(tiles.len(), |i| on_one_thread(|| in_tile(&tiles[i])))?,
        };
        Ok(found.into_iter().flatten().collect())
    }
}

/// The longer side of a mask's box, pixels of the photo.
fn longer_side(candidate: &Candidate) -> f64 {
    let pixels = &candidate.mask.pixels;
    f64::from(pixels.width().max(pixels.height()))
}

/// Where stones were seen, and how large.
struct Seen(Vec<SeenStone>);

struct SeenStone {
    /// Middle of its box, pixels of the photo.
    middle: [u32; 2],
    /// Pixels of the photo.
    area: f64,
    is_cut: bool,
}

impl Seen {
    fn of(candidates: &[Candidate]) -> Self {
        let stone = |c: &Candidate| SeenStone {
            middle: [
                c.mask.left + c.mask.pixels.width() / 2,
                c.mask.top + c.mask.pixels.height() / 2,
            ],
            area: f64::from(c.area),
            is_cut: c.is_cut,
        };
        Self(candidates.iter().map(stone).collect())
    }

    fn inside(&self, part: &Rect) -> impl Iterator<Item = &SeenStone> {
        let columns = part.left..part.left + part.width;
        let rows = part.top..part.top + part.height;
        let is_inside = move |s: &&SeenStone| columns.contains(&s.middle[0]) && rows.contains(&s.middle[1]);
        self.0.iter().filter(is_inside)
    }

    /// Whether a part of the photo shows a wall, a tenth of it stones, of which at least a quarter are less
    /// than `limit` across.
    fn has_small(&self, part: &Rect, limit: f64) -> bool {
        let whole = self.inside(part).filter(|s| !s.is_cut);
        let (mut all, mut small, mut area) = (0, 0, 0.0);
        for stone in whole {
            all += 1;
            small += usize::from(stone.area < limit * limit);
            area += stone.area;
        }
        let is_wall = 10.0 * area >= f64::from(part.width) * f64::from(part.height);
        is_wall && 4 * small >= all
    }

    /// Whether stones of more than `limit` across, cut ones too, hold a quarter of the area found in a part
    /// of the photo; also where there is none.
    fn has_large(&self, part: &Rect, limit: f64) -> bool {
        let (mut all, mut large) = (0.0, 0.0);
        for stone in self.inside(part) {
            all += stone.area;
            if stone.area > limit * limit {
                large += stone.area;
            }
        }
        4.0 * large >= all
    }
}
