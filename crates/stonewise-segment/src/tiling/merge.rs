//! One stone from many candidates.

use super::candidate::Candidate;
use super::choice::choose;
use super::options::TilingOptions;
use super::overlap::{common_pixels, extent, intersection, pixels_in};
use crate::{Patch, Segmentation};
use std::collections::BTreeMap;
use stonewise_core::components::components;
use stonewise_core::raster::{LabelImage, Raster, connected_components};

/// Two cut masks of neighbouring tiles are one stone if, where both tiles see, this share of the smaller lies
/// in the larger.
const SAME_STONE_SHARE: f64 = 0.5;

/// Chooses among candidates and lays them on a photo from best to worst.
///
/// Masks that the border of a tile cuts are joined with what the neighbouring tile shows of the same stone,
/// and come after all whole ones: only stones larger than the overlap at every scale are made of them. A cut
/// mask that no neighbouring tile confirms is dropped. Of the rest the higher score wins, then the
/// finer scale.
pub fn merge(candidates: Vec<Candidate>, width: u32, height: u32, options: &TilingOptions) -> Segmentation {
    let (cut, whole): (Vec<_>, Vec<_>) = candidates.into_iter().partition(|c| c.is_cut);
    let mut all = choose(best_first(whole));
    all.extend(choose(best_first(joined(cut))));
    let mut painted: LabelImage = Raster::filled(width, height, 0);
    let mut scores = Vec::new();
    for candidate in &all {
        let mut new = 0;
        for_each_pixel(&candidate.mask, |x, y| {
            new += u32::from(painted.get(x, y) == Some(&0))
        });
        let is_new = f64::from(new) >= options.min_new_share * f64::from(candidate.area);
        if is_new && new >= options.min_area_px {
            scores.push(candidate.score);
            let label = scores.len() as u32;
            for_each_pixel(&candidate.mask, |x, y| {
                if let Some(pixel) = painted.get_mut(x, y).filter(|p| **p == 0) {
                    *pixel = label;
                }
            });
        }
    }
    without_fragments(&painted, &scores, options.min_area_px)
}

/// Candidates in descending order of score, the finer scale first among equals.
fn best_first(mut candidates: Vec<Candidate>) -> Vec<Candidate> {
    let place = |c: &Candidate| (c.scale, c.mask.top, c.mask.left, c.area);
    candidates.sort_by(|a, b| b.score.total_cmp(&a.score).then(place(a).cmp(&place(b))));
    candidates
}

/// The largest part of every stone, numbered by its first pixel in row order.
fn without_fragments(painted: &LabelImage, scores: &[f32], min_area_px: u32) -> Segmentation {
    let (mut labels, parts) = connected_components(painted);
    let mut largest: BTreeMap<u32, usize> = BTreeMap::new();
    for (index, part) in parts.iter().enumerate() {
        let best = largest.entry(part.label).or_insert(index);
        if parts[*best].area < part.area {
            *best = index;
        }
    }
    let mut kept: Vec<usize> = largest
        .into_values()
        .filter(|&i| parts[i].area >= min_area_px)
        .collect();
    kept.sort_unstable();
    let mut number = vec![0u32; parts.len() + 1];
    let mut stones = BTreeMap::new();
    for (index, id) in kept.into_iter().zip(1..) {
        number[index + 1] = id;
        stones.insert(id, scores[parts[index].label as usize - 1]);
    }
    for label in labels.data_mut() {
        *label = number[*label as usize];
    }
    Segmentation {
        labels,
        scores: stones,
    }
}

/// Cut masks of which neighbouring tiles show parts of one stone, joined; the others are left out. Cost:
/// O(n^2) tests of rectangles.
fn joined(cut: Vec<Candidate>) -> Vec<Candidate> {
    let mut same = vec![Vec::new(); cut.len()];
    for second in 0..cut.len() {
        for first in 0..second {
            if is_same_stone(&cut[first], &cut[second]) {
                same[first].push(second);
                same[second].push(first);
            }
        }
    }
    let mut groups = components(cut.len(), |mask| same[mask].iter().copied());
    groups.retain(|members| members.len() > 1);
    let whole = |mut members: Vec<usize>| {
        members.sort_unstable();
        union(&members.into_iter().map(|i| &cut[i]).collect::<Vec<_>>())
    };
    groups.into_iter().map(whole).collect()
}

fn is_same_stone(a: &Candidate, b: &Candidate) -> bool {
    if a.scale != b.scale || a.tile == b.tile {
        return false;
    }
    let Some(zone) = intersection(&a.tile, &b.tile) else {
        return false;
    };
    let parts = [a, b].map(|c| intersection(&zone, &extent(&c.mask)));
    let [Some(in_a), Some(in_b)] = parts else {
        return false;
    };
    let smaller = pixels_in(&a.mask, &in_a).min(pixels_in(&b.mask, &in_b));
    let both = common_pixels(&a.mask, &b.mask);
    both > 0 && f64::from(both) >= SAME_STONE_SHARE * f64::from(smaller)
}

/// All masks as one, with the best score.
fn union(members: &[&Candidate]) -> Candidate {
    let mut all = members[0].clone();
    for member in &members[1..] {
        let [a, b] = [&all.mask, &member.mask].map(extent);
        let (left, top) = (a.left.min(b.left), a.top.min(b.top));
        let right = (a.left + a.width).max(b.left + b.width);
        let bottom = (a.top + a.height).max(b.top + b.height);
        let mut pixels = Raster::filled(right - left, bottom - top, false);
        for mask in [&all.mask, &member.mask] {
            for_each_pixel(mask, |x, y| {
                if let Some(pixel) = pixels.get_mut(x - left, y - top) {
                    *pixel = true;
                }
            });
        }
        all.area = pixels.data().iter().filter(|p| **p).count() as u32;
        all.mask = Patch { left, top, pixels };
        all.score = all.score.max(member.score);
    }
    all
}

fn for_each_pixel(mask: &Patch, mut act: impl FnMut(u32, u32)) {
    let width = mask.pixels.width() as usize;
    for (y, row) in mask.pixels.data().chunks(width.max(1)).enumerate() {
        for (x, _) in row.iter().enumerate().filter(|(_, set)| **set) {
            act(mask.left + x as u32, mask.top + y as u32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::grid::Rect;
    use super::*;

    /// A mask over `columns` of the photo's rows 10 to 30, cut by the border of a tile that begins at a
    /// column; tiles are 60 x 60 pixels.
    fn cut(columns: std::ops::Range<u32>, tile_left: u32) -> Candidate {
        let (width, height) = (columns.end - columns.start, 20);
        Candidate {
            mask: Patch {
                left: columns.start,
                top: 10,
                pixels: Raster::filled(width, height, true),
            },
            area: width * height,
            score: 0.9,
            scale: 0,
            tile: Rect {
                left: tile_left,
                top: 0,
                width: 60,
                height: 60,
            },
            is_cut: true,
        }
    }

    #[test]
    fn a_cut_mask_counts_where_the_neighbouring_tile_shows_the_stone_too() {
        let stones = |all: Vec<Candidate>| merge(all, 100, 60, &TilingOptions::default());
        let (left, right) = (cut(20..60, 0), cut(40..80, 40));
        assert!(stones(vec![left.clone()]).scores.is_empty());
        let both = stones(vec![left, right]);
        let pixels = both.labels.data().iter().filter(|&&label| label == 1).count();
        assert_eq!((both.scores.len(), pixels), (1, 60 * 20));
    }
}
