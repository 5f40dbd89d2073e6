//! How large the stones of a wall are, from a first look at a few views.

use super::drawing::{Drawing, batches, drop_empty};
use crate::error::Result;
use std::collections::BTreeMap;
use stonewise_core::statistics::quantile;
use stonewise_core::transfer::photo_relief;
use stonewise_core::views::{PlannedView, megapixels_of};
use stonewise_segment::tiling::segment_photo;
use stonewise_segment::{StoneFinder, Weights};

/// Pixels of the first look, millions: about a hundred stones on most walls.
const LOOK_MEGAPIXELS: f64 = 4.0;
/// Views of the first look at least.
const LEAST_VIEWS: usize = 3;
/// Fewest stones from which the size of stones is estimated.
const LEAST_STONES: usize = 20;
/// Share of the stones that are smaller than the size returned.
const SMALLER: f64 = 0.25;

/// The lower quartile of the sizes of stones (square roots of their areas), metres; none where the views show few.
pub fn smaller_stones(drawing: &Drawing, planned: &[PlannedView]) -> Result<Option<f64>> {
    let context = drawing.context;
    let settings = &context.project.settings;
    let (tiling, progress) = (&settings.segment.tiling, context.progress);
    let weights = Weights::named(&settings.segment.model);
    let finder = StoneFinder::open(&weights, tiling.min_score as f32)?;
    let takes_relief = weights.takes_relief()?;
    let mut sizes_m: Vec<f64> = Vec::new();

    for batch in batches(&spread(planned)) {
        let images = drawing.images(batch)?;
        let cameras = batch.iter().map(|planned| &planned.view.camera);
        let tiles = cameras.map(|c| tiling.tile_count(c.width, c.height, 1.0)).sum();
        progress.begin("a first look at the size of stones", tiles);
        for (planned, image) in batch.iter().zip(images) {
            let relief = takes_relief
                .then(|| photo_relief(drawing.tiles, &planned.view, &settings.label, progress))
                .transpose()?;
            let mut stones = segment_photo(&finder, &image, 1.0, relief.as_ref(), tiling, progress)?;
            drop_empty(&mut stones, &image);
            let mut areas_px: BTreeMap<u32, u64> = BTreeMap::new();
            for id in stones.labels.data().iter().filter(|id| **id > 0) {
                *areas_px.entry(*id).or_default() += 1;
            }
            sizes_m.extend(
                areas_px
                    .into_values()
                    .map(|px| planned.pixel_m * (px as f64).sqrt()),
            );
        }
    }

    sizes_m.sort_by(f64::total_cmp);
    Ok((sizes_m.len() >= LEAST_STONES).then(|| quantile(&sizes_m, SMALLER)))
}

/// Straight-on views, spread evenly over the list, with about [`LOOK_MEGAPIXELS`] together.
fn spread(planned: &[PlannedView]) -> Vec<PlannedView> {
    let straight: Vec<PlannedView> = planned.iter().filter(|p| p.is_straight).cloned().collect();
    let part = (LOOK_MEGAPIXELS / megapixels_of(&straight)).min(1.0);
    let count = (part * straight.len() as f64).ceil() as usize;
    let count = count.max(LEAST_VIEWS).min(straight.len());
    let place = |i: usize| (2 * i + 1) * straight.len() / (2 * count);
    (0..count).map(|i| straight[place(i)].clone()).collect()
}
