//! Pictures of the points of an epoch, as cameras would take them.

use crate::error::Result;
use crate::pipeline::context::Context;
use crate::storage::tiles::{DiskTiles, TileValues};
use rayon::prelude::*;
use std::collections::BTreeMap;
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::raster::RgbImage;
use stonewise_core::views::{Picture, PlannedView, Shade, Tones, Toning, Walls};
use stonewise_segment::Segmentation;

/// Memory for the pictures that are drawn at a time.
pub const PICTURE_BYTES: u64 = 512 << 20;

/// Views whose pictures fit into memory together.
pub fn batches(views: &[PlannedView]) -> Vec<&[PlannedView]> {
    let mut batches = Vec::new();
    let (mut start, mut bytes) = (0, 0);
    for (i, PlannedView { view, .. }) in views.iter().enumerate() {
        let own = Picture::PIXEL_BYTES * u64::from(view.camera.width) * u64::from(view.camera.height);
        if i > start && bytes + own > PICTURE_BYTES {
            batches.push(&views[start..i]);
            (start, bytes) = (i, 0);
        }
        bytes += own;
    }
    batches.push(&views[start..]);
    batches
}

/// Colours and intensities of all points of an epoch.
pub fn tones(context: &Context, tiles: &DiskTiles) -> Result<Tones> {
    let mut tones = Tones::default();
    context
        .progress
        .begin("colours and intensities", tiles.tile_count() as u64);
    for tile in 0..tiles.tile_count() {
        context.progress.check()?;
        let values = tiles.values(tile)?;
        tones.add(&tiles.load(tile)?, &values.borrowed());
        context.progress.advance(1);
    }
    Ok(tones)
}

/// Draws the points of a tile in a picture.
type Draw<'c, 'v> = Box<dyn Fn(&mut Picture<'v>) + Sync + 'c>;

/// What pictures are drawn from.
pub struct Drawing<'a> {
    pub context: &'a Context<'a>,
    pub tiles: &'a DiskTiles,
    pub toning: &'a Toning,
    pub walls: &'a Walls<'a>,
}

impl Drawing<'_> {
    /// Draws a few views.
    pub fn images(&self, views: &[PlannedView]) -> Result<Vec<RgbImage>> {
        let pictures = self.pictures(views)?;
        let image = |picture: Picture| match self.toning.shade() {
            Shade::Relief => picture.relief(),
            Shade::Colour | Shade::Intensity => picture.image(),
        };
        Ok(pictures.into_iter().map(image).collect())
    }

    fn pictures<'v>(&self, views: &'v [PlannedView]) -> Result<Vec<Picture<'v>>> {
        let mut pictures: Vec<Picture> = views.iter().map(Picture::new).collect();
        self.pass(&mut pictures, "depths", |_, cloud| {
            Ok(Box::new(move |picture: &mut Picture| picture.add_depths(cloud)))
        })?;
        self.pass(&mut pictures, "values", |tile, cloud| {
            let raw: TileValues = self.tiles.values(tile)?;
            let values = self.toning.values(cloud, &raw.borrowed(), self.walls);
            Ok(Box::new(move |picture: &mut Picture| {
                picture.add_values(cloud, &values);
            }))
        })?;
        Ok(pictures)
    }

    /// Shows every tile to the pictures that may show it.
    fn pass<'v>(
        &self,
        pictures: &mut [Picture<'v>],
        what: &str,
        draw: impl for<'c> Fn(usize, &'c Cloud) -> Result<Draw<'c, 'v>>,
    ) -> Result<()> {
        let progress = self.context.progress;
        progress.begin(&format!("views: {what}"), self.tiles.tile_count() as u64);
        for tile in 0..self.tiles.tile_count() {
            progress.check()?;
            let bounds = self.tiles.bounds(tile);
            if pictures.iter().any(|p| p.may_show(&bounds)) {
                let cloud = self.tiles.load(tile)?;
                let draw = draw(tile, &cloud)?;
                pictures
                    .par_iter_mut()
                    .filter(|p| p.may_show(&bounds))
                    .for_each(&draw);
            }
            progress.advance(1);
        }
        Ok(())
    }
}

/// Takes away what a view does not show, such as level ground, which is black: the detector sees its relief all the
/// same. An instance of which most goes is no stone.
pub fn drop_empty(stones: &mut Segmentation, view: &RgbImage) {
    let is_empty = |pixel: &[u8; 3]| *pixel == [0; 3];
    let mut counts: BTreeMap<u32, [usize; 2]> = BTreeMap::new();
    for (id, pixel) in stones.labels.data().iter().zip(view.data()) {
        counts.entry(*id).or_default()[usize::from(is_empty(pixel))] += 1;
    }
    stones
        .scores
        .retain(|id, _| counts.get(id).is_some_and(|[shown, empty]| shown >= empty));
    for (id, pixel) in stones.labels.data_mut().iter_mut().zip(view.data()) {
        if is_empty(pixel) || !stones.scores.contains_key(id) {
            *id = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::raster::Raster;

    #[test]
    fn what_a_view_leaves_black_is_no_stone() {
        // A stone on the wall, one that reaches over its foot, and one on the ground.
        let mut stones = Segmentation {
            labels: Raster::from_vec(4, 3, vec![1, 1, 2, 2, 1, 1, 2, 0, 3, 3, 2, 0]).unwrap(),
            scores: [1, 2, 3].map(|id| (id, 0.9)).into(),
        };
        let view = (0..12).map(|at| if at < 8 { [90; 3] } else { [0; 3] }).collect();
        drop_empty(&mut stones, &Raster::from_vec(4, 3, view).unwrap());
        assert_eq!(stones.labels.data(), [1, 1, 2, 2, 1, 1, 2, 0, 0, 0, 0, 0]);
        assert_eq!(stones.scores.into_keys().collect::<Vec<u32>>(), [1, 2]);
    }
}
