//! Training targets from a labelled photo.

use super::boxes::{Bounds, area, clip};
use super::preprocess::Seen;
use crate::Sample;
use std::collections::BTreeMap;
use stonewise_core::raster::Raster;

/// A box of whose pixels more than this share are ignored says nothing about background.
const MAX_IGNORED: f32 = 0.5;
/// Sampling points along a side of a mask's cell, at most.
const MAX_POINTS: usize = 4;

/// The stones of a photo at the size at which the model looks at it.
pub struct Targets<'a> {
    sample: &'a Sample,
    seen: Seen,
    labels: Vec<u32>,
    /// Bounds of the stones, pixels of the model.
    pub bounds: Vec<Bounds>,
    ignored: Option<Sums>,
}

impl<'a> Targets<'a> {
    /// The stones of at least `min_pixels` pixels, by rising label.
    pub fn new(sample: &'a Sample, seen: Seen, min_pixels: usize) -> Self {
        let labels = sample.labels();
        let width = labels.width() as usize;
        // Pixels and bounds, of which right and bottom are the last inside.
        let mut stones: BTreeMap<u32, (usize, [usize; 4])> = BTreeMap::new();

        for (place, &label) in labels.data().iter().enumerate() {
            if label == 0 {
                continue;
            }
            let (x, y) = (place % width, place / width);
            let (pixels, [left, top, right, bottom]) = stones.entry(label).or_insert((0, [x, y, x, y]));
            *pixels += 1;
            *left = x.min(*left);
            *top = y.min(*top);
            *right = x.max(*right);
            *bottom = y.max(*bottom);
        }

        stones.retain(|_, (pixels, _)| *pixels >= min_pixels);
        let [sx, sy] = seen.scale;
        let bounds = |(_, [left, top, right, bottom]): &(usize, [usize; 4])| {
            let [left, top, right, bottom] = [*left, *top, right + 1, bottom + 1].map(|side| side as f32);
            [left * sx, top * sy, right * sx, bottom * sy]
        };

        Self {
            sample,
            seen,
            labels: stones.keys().copied().collect(),
            bounds: stones.values().map(bounds).collect(),
            ignored: sample
                .ignore()
                .data()
                .contains(&true)
                .then(|| Sums::new(sample.ignore())),
        }
    }

    /// False for a box that lies mostly where nothing is known.
    pub fn is_known(&self, bounds: Bounds) -> bool {
        let Some(ignored) = &self.ignored else {
            return true;
        };
        let [width, height] = self.seen.extent();
        let [left, top, right, bottom] = clip(bounds, width, height);
        let [sx, sy] = self.seen.scale;
        let inside = [left / sx, top / sy, right / sx, bottom / sy];
        ignored.within(inside) <= MAX_IGNORED * area(inside)
    }

    /// Share of a stone's pixels in each of `cells` x `cells` cells of a box, row by row.
    pub fn mask(&self, stone: usize, bounds: Bounds, cells: usize) -> Vec<f32> {
        let labels = self.sample.labels();
        let [sx, sy] = self.seen.scale;
        let points = |from: f32, to: f32| {
            let count = (((to - from) / cells as f32).ceil() as usize).clamp(1, MAX_POINTS);
            let total = count * cells;
            let at = move |place: usize| (from + (place as f32 + 0.5) * (to - from) / total as f32).floor();
            (count, (0..total).map(at).collect::<Vec<f32>>())
        };
        let (across, xs) = points(bounds[0] / sx, bounds[2] / sx);
        let (down, ys) = points(bounds[1] / sy, bounds[3] / sy);
        let share = 1.0 / (across * down) as f32;
        let inside = |x: f32, y: f32| {
            x >= 0.0 && y >= 0.0 && labels.get(x as u32, y as u32) == Some(&self.labels[stone])
        };
        let mut mask = vec![0.0; cells * cells];
        for (row, &y) in ys.iter().enumerate() {
            for (column, &x) in xs.iter().enumerate() {
                if inside(x, y) {
                    mask[row / down * cells + column / across] += share;
                }
            }
        }
        mask
    }
}

/// Sums over all rectangles from the image's corner (Crow 1984).
struct Sums {
    stride: usize,
    sums: Vec<u32>,
}

impl Sums {
    fn new(raster: &Raster<bool>) -> Self {
        let stride = raster.width() as usize + 1;
        let mut sums = vec![0; stride * (raster.height() as usize + 1)];
        for (row, pixels) in raster.data().chunks(stride - 1).enumerate() {
            let mut in_row = 0;
            for (column, &pixel) in pixels.iter().enumerate() {
                in_row += u32::from(pixel);
                sums[(row + 1) * stride + column + 1] = sums[row * stride + column + 1] + in_row;
            }
        }
        Self { stride, sums }
    }

    /// Number of set pixels within a box inside the image, to the nearest pixel at its sides.
    fn within(&self, bounds: Bounds) -> f32 {
        let [left, top, right, bottom] = bounds.map(|side| side.round() as usize);
        let at = |x: usize, y: usize| f64::from(self.sums[y * self.stride + x]);
        (at(right, bottom) - at(left, bottom) - at(right, top) + at(left, top)) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::raster::{LabelImage, RgbImage};

    fn sample() -> Sample {
        let mut labels: LabelImage = Raster::filled(40, 20, 0);
        let mut ignore = Raster::filled(40, 20, false);
        for y in 4..12 {
            for x in 6..16 {
                *labels.get_mut(x, y).unwrap() = 9;
            }
            for x in 20..40 {
                *ignore.get_mut(x, y).unwrap() = true;
            }
        }
        *labels.get_mut(30, 1).unwrap() = 3;
        let image: RgbImage = Raster::filled(40, 20, [0; 3]);
        Sample::new(image, labels, ignore).unwrap()
    }

    #[test]
    fn stones_get_tight_boxes_and_tiny_ones_none() {
        let sample = sample();
        let seen = Seen {
            size: [80, 20],
            scale: [2.0, 1.0],
        };
        let targets = Targets::new(&sample, seen, 2);
        assert_eq!(targets.bounds, [[12.0, 4.0, 32.0, 12.0]]);
        // The left half of the box is stone, but for the upper quarter.
        let mask = targets.mask(0, [12.0, 0.0, 52.0, 16.0], 4);
        let expected = [[0.0; 4], [1.0, 1.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0], [0.0; 4]].concat();
        assert_eq!(mask, expected);
        let half = targets.mask(0, [22.0, 4.0, 42.0, 12.0], 1);
        assert_eq!(half, [0.5]);
    }

    #[test]
    fn boxes_where_nothing_is_known_are_told() {
        let sample = sample();
        let seen = Seen {
            size: [80, 20],
            scale: [2.0, 1.0],
        };
        let targets = Targets::new(&sample, seen, 2);
        assert!(targets.is_known([0.0, 0.0, 40.0, 20.0]));
        assert!(!targets.is_known([40.0, 4.0, 60.0, 12.0]));
        assert!(!targets.is_known([30.0, 4.0, 100.0, 12.0]));
        assert!(targets.is_known([20.0, 4.0, 50.0, 12.0]));
    }
}
