//! The stones that boxes hold, in a photo of any size.

use super::candidate::candidate;
use super::grid::Rect;
use super::options::TilingOptions;
use super::pyramid::crop;
use super::segment::Size;
use crate::{Patch, Segmentation, StoneFinder};
use std::cmp::Reverse;
use std::collections::BTreeMap;
use stonewise_core::parallel::{in_parallel, on_one_thread};
use stonewise_core::progress::{Interrupted, Progress};
use stonewise_core::raster::{Raster, ReliefMap, RgbImage};

/// Left, top, right, bottom, pixels of the photo.
type PixelBox = [f64; 4];

/// The stone of one box.
struct Outlined {
    label: u32,
    score: f32,
    area: u32,
    mask: Patch,
}

/// The stones that boxes of a photo hold; the stone of the first box has label 1, and so on.
///
/// `boxes`: left, top, right, bottom, pixels; `relief`: as for [`segment_photo`](super::segment_photo). Each box
/// is looked at in one tile around it, at the smallest of `options.scales` at which it is at least
/// [`stone_px`](TilingOptions::stone_px) across, else at the largest. Where masks overlap, the smaller one is on
/// top; a stone without a pixel is missing. Scores do not decide: a person says that there is a stone. `progress`
/// advances by one for every box.
///
/// # Errors
/// The caller stopped it.
pub fn outline_boxes(
    finder: &StoneFinder,
    photo: &RgbImage,
    relief: Option<&ReliefMap>,
    boxes: &[PixelBox],
    options: &TilingOptions,
    progress: &dyn Progress,
) -> Result<Segmentation, Interrupted> {
    let mut by_scale: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (i, bounds) in boxes.iter().enumerate() {
        by_scale.entry(scale_for(bounds, options)).or_default().push(i);
    }
    let mut found = Vec::new();

    for (scale, members) in by_scale {
        let size = Size::of(photo, &options.scales, scale);
        let mut by_tile: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
        for i in members {
            let tile = tile_around(&size, &boxes[i], options.tile_px);
            by_tile.entry([tile.left, tile.top]).or_default().push(i);
        }
        let tiles: Vec<Vec<usize>> = by_tile.into_values().collect();
        let in_tile = |members: &[usize]| {
            progress.check()?;
            let tile = tile_around(&size, &boxes[members[0]], options.tile_px);
            let stones = stones_in(finder, &size, &tile, relief, boxes, members);
            progress.advance(members.len() as u64);
            Ok(stones)
        };
        let stones = match &tiles[..] {
            [one] => vec![in_tile(one)?],
            _ => in_parallel(tiles.len(), |i| on_one_thread(|| in_tile(&tiles[i])))?,
        };
        found.extend(stones.into_iter().flatten());
    }

    Ok(laid(found, photo))
}

/// Place of the scale at which a box is looked at, in the list of scales.
fn scale_for([left, top, right, bottom]: &PixelBox, options: &TilingOptions) -> usize {
    let across = ((right - left) * (bottom - top)).max(0.0).sqrt();
    let by_scale = |&(a, _): &(f64, usize), &(b, _): &(f64, usize)| a.total_cmp(&b);
    let scales = || options.scales.iter().copied().zip(0..);
    let large_enough = scales().filter(|(scale, _)| across * scale >= options.stone_px);
    let chosen = large_enough
        .min_by(by_scale)
        .or_else(|| scales().max_by(by_scale));
    chosen.map_or(0, |(_, place)| place)
}

/// The tile in whose middle half a box has its centre, or which is nearest to that inside the photo.
fn tile_around(size: &Size, bounds: &PixelBox, tile_px: u32) -> Rect {
    let [width, height] = size.scaling.scaled;
    let along = |side: usize, whole: u32| {
        let factor = f64::from(whole) / f64::from(size.scaling.photo[side]);
        let centre = (bounds[side] + bounds[side + 2]) / 2.0 * factor;
        let step = f64::from(tile_px) / 2.0;
        let origin = ((centre / step - 1.0).round() * step).max(0.0) as u32;
        origin.min(whole.saturating_sub(tile_px))
    };
    Rect {
        left: along(0, width),
        top: along(1, height),
        width: tile_px.min(width),
        height: tile_px.min(height),
    }
}

/// The stones of the boxes that a tile holds.
fn stones_in(
    finder: &StoneFinder,
    size: &Size,
    tile: &Rect,
    relief: Option<&ReliefMap>,
    boxes: &[PixelBox],
    members: &[usize],
) -> Vec<Outlined> {
    let relief = relief.map(|relief| size.relief(relief, tile));
    let in_tile = |&i: &usize| {
        let [fx, fy] =
            [0, 1].map(|side| f64::from(size.scaling.scaled[side]) / f64::from(size.scaling.photo[side]));
        let [left, top, right, bottom] = boxes[i];
        let [x, y] = [f64::from(tile.left), f64::from(tile.top)];
        [left * fx - x, top * fy - y, right * fx - x, bottom * fy - y].map(|v| v as f32)
    };
    let regions: Vec<[f32; 4]> = members.iter().map(in_tile).collect();
    let stones = finder.outline(&crop(&size.image, tile), relief.as_ref(), &regions);
    let in_photo = |(&i, stone)| {
        let found = candidate(stone, tile, &size.scaling)?;
        Some(Outlined {
            label: i as u32 + 1,
            score: found.score,
            area: found.area,
            mask: found.mask,
        })
    };
    members.iter().zip(&stones).filter_map(in_photo).collect()
}

/// Masks on the photo, the smaller one on top.
fn laid(mut found: Vec<Outlined>, photo: &RgbImage) -> Segmentation {
    found.sort_by_key(|stone| (Reverse(stone.area), stone.label));
    let mut labels = Raster::filled(photo.width(), photo.height(), 0u32);
    for stone in &found {
        let (mask, width) = (&stone.mask, stone.mask.pixels.width());
        for (i, _) in mask
            .pixels
            .data()
            .iter()
            .enumerate()
            .filter(|(_, inside)| **inside)
        {
            let i = i as u32;
            if let Some(label) = labels.get_mut(mask.left + i % width, mask.top + i / width) {
                *label = stone.label;
            }
        }
    }
    let mut is_seen = vec![false; found.iter().map(|s| s.label as usize + 1).max().unwrap_or(1)];
    labels
        .data()
        .iter()
        .for_each(|&label| is_seen[label as usize] = true);
    let seen = found.iter().filter(|s| is_seen[s.label as usize]);
    let scores = seen.map(|s| (s.label, s.score)).collect();
    Segmentation { labels, scores }
}
