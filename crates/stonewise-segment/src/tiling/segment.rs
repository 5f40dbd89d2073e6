//! A photo, tile by tile.

use super::candidate::{Candidate, Scaling, candidate};
use super::grid::tiles;
use super::merge::merge;
use super::options::TilingOptions;
use super::pyramid::{at_scale, crop};
use crate::{Detector, Segmentation};
use stonewise_core::progress::{Interrupted, Progress};
use stonewise_core::raster::RgbImage;

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

/// The stones of a photo of any size.
///
/// `progress` advances by one for every tile, [`TilingOptions::tile_count`] in all. Memory: the photo once more at each scale in turn, one
/// tile in the detector, and the masks found. The result does not depend on the number of threads if the detector's does not.
///
/// # Errors
/// The detector could not run, or the caller stopped it.
pub fn segment_photo<D: Detector>(
    detector: &D,
    photo: &RgbImage,
    options: &TilingOptions,
    progress: &dyn Progress,
) -> Result<Segmentation, TilingError<D::Error>> {
    let mut candidates: Vec<Candidate> = Vec::new();
    let scales = options.scales_for(photo.width(), photo.height());
    for (index, &scale) in scales.iter().enumerate() {
        let image = at_scale(photo, scale);
        let scaling = Scaling {
            index,
            photo: [photo.width(), photo.height()],
            scaled: [image.width(), image.height()],
        };
        for tile in tiles(image.width(), image.height(), options.tile_px, options.overlap_px) {
            progress.check()?;
            let found = detector
                .detect(&crop(&image, &tile))
                .map_err(TilingError::Detector)?;
            let good = found.iter().filter(|d| d.score >= options.min_score);
            candidates.extend(good.filter_map(|d| candidate(d, &tile, &scaling)));
            progress.advance(1);
        }
    }
    Ok(merge(candidates, photo.width(), photo.height(), options))
}
