//! From a region's mask to pixels of the image.

use super::boxes::Bounds;
use crate::{Patch, model::boxes::clip};
use stonewise_core::raster::Raster;

/// Probability from which a pixel is part of a stone.
const THRESHOLD: f32 = 0.5;

/// The pixels of an image whose centres a mask of `cells` x `cells` probabilities, stretched over `bounds`
/// and interpolated bilinearly between cell centres, calls inside. Beyond the outermost centres probabilities
/// fall to 0 within a cell.
pub fn paste_mask(mask: &[f32], cells: usize, bounds: Bounds, [width, height]: [u32; 2]) -> Patch {
    let [left, top, right, bottom] = clip(bounds, width as f32, height as f32);
    // Never without a pixel: a box between two pixels gets the one it lies in.
    let (left, top) = ((left as u32).min(width - 1), (top as u32).min(height - 1));
    let columns = (right.ceil() as u32).clamp(left + 1, width) - left;
    let rows = (bottom.ceil() as u32).clamp(top + 1, height) - top;
    let xs = taps(left, columns, bounds[0], bounds[2], cells);
    let ys = taps(top, rows, bounds[1], bounds[3], cells);
    let value = |x: isize, y: isize| {
        let inside = |v: isize| (0..cells as isize).contains(&v);
        if inside(x) && inside(y) {
            mask[y as usize * cells + x as usize]
        } else {
            0.0
        }
    };
    let mut pixels = Raster::filled(columns, rows, false);
    for ((y, down), row) in ys.iter().zip(pixels.data_mut().chunks_mut(columns as usize)) {
        for ((x, along), pixel) in xs.iter().zip(row) {
            let above = value(*x, *y) * (1.0 - along) + value(x + 1, *y) * along;
            let below = value(*x, y + 1) * (1.0 - along) + value(x + 1, y + 1) * along;
            *pixel = above * (1.0 - down) + below * down >= THRESHOLD;
        }
    }
    Patch { left, top, pixels }
}

/// For each pixel of an axis the cell before its centre and how far it is to the next.
fn taps(first: u32, count: u32, from: f32, to: f32, cells: usize) -> Vec<(isize, f32)> {
    let tap = |pixel: u32| {
        let at =
            ((first + pixel) as f32 + 0.5 - from) / (to - from).max(f32::MIN_POSITIVE) * cells as f32 - 0.5;
        let low = at.floor();
        (low as isize, at - low)
    };
    (0..count).map(tap).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disc_is_pasted_as_a_disc() {
        let cells = 28;
        let inside = |i: usize| {
            let [x, y] = [i % cells, i / cells].map(|v| (v as f32 + 0.5) / cells as f32 - 0.5);
            if x.hypot(y) < 0.4 { 1.0 } else { 0.0 }
        };
        let mask: Vec<f32> = (0..cells * cells).map(inside).collect();
        let patch = paste_mask(&mask, cells, [10.3, 20.6, 110.3, 80.6], [200, 200]);
        let (mut both, mut any) = (0.0, 0.0);
        for (i, &pixel) in patch.pixels.data().iter().enumerate() {
            let [x, y] = [
                i as u32 % patch.pixels.width() + patch.left,
                i as u32 / patch.pixels.width() + patch.top,
            ];
            let [x, y] = [(x as f32 + 0.5 - 60.3) / 100.0, (y as f32 + 0.5 - 50.6) / 60.0];
            let truth = x.hypot(y) < 0.4;
            both += f32::from(u8::from(pixel && truth));
            any += f32::from(u8::from(pixel || truth));
        }
        assert!(both / any > 0.97, "{}", both / any);
    }

    #[test]
    fn boxes_at_the_edge_keep_their_place() {
        let mask = [1.0; 4];
        let patch = paste_mask(&mask, 2, [-10.0, 5.0, 10.0, 15.0], [8, 12]);
        assert_eq!((patch.left, patch.top), (0, 5));
        assert_eq!((patch.pixels.width(), patch.pixels.height()), (8, 7));
        assert!(patch.pixels.data().iter().filter(|&&inside| inside).count() > 40);
        let outside = paste_mask(&mask, 2, [20.0, 20.0, 20.0, 20.0], [8, 12]);
        assert_eq!(
            (outside.left, outside.top, outside.pixels.data().len()),
            (7, 11, 1)
        );
    }
}
