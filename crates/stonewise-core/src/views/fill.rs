//! Small gaps between the spots of points.

use crate::raster::{RgbImage, closed};

/// Fills gaps of up to twice `half_gap` pixels with the mean of the known pixels around; larger gaps, and what
/// lies outside the cloud, stay as they are.
pub(super) fn fill_gaps(image: &mut RgbImage, known: &mut [bool], half_gap: usize) {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let wanted = closed(known, width, height, half_gap);
    // From the rims inward, one pixel a round, so that a gap takes the colours of its own border.
    for _ in 0..=half_gap {
        let mut filled = Vec::new();
        for at in (0..known.len()).filter(|&at| wanted[at] && !known[at]) {
            let (x, y) = (at % width, at / width);
            let (mut sum, mut count) = ([0u32; 3], 0);
            for ny in y.saturating_sub(1)..=(y + 1).min(height - 1) {
                for nx in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                    let near = ny * width + nx;
                    if known[near] {
                        count += 1;
                        for (s, v) in sum.iter_mut().zip(image.data()[near]) {
                            *s += u32::from(v);
                        }
                    }
                }
            }
            if count > 0 {
                filled.push((at, sum.map(|s| ((s + count / 2) / count) as u8)));
            }
        }
        if filled.is_empty() {
            return;
        }
        for (at, value) in filled {
            image.data_mut()[at] = value;
            known[at] = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HALF_GAP: usize = 8;

    #[test]
    fn narrow_gaps_are_filled_and_wide_ones_stay() {
        let (width, height) = (80, 60);
        let is_gap = |x: usize, y: usize| {
            (10..26).contains(&x) && y > 5 || (40..62).contains(&x) && (20..50).contains(&y)
        };
        let mut known: Vec<bool> = (0..width * height)
            .map(|i| !is_gap(i % width, i / width))
            .collect();
        let mut image = RgbImage::filled(width as u32, height as u32, [90, 120, 200]);
        for (pixel, known) in image.data_mut().iter_mut().zip(&known) {
            if !known {
                *pixel = [0; 3];
            }
        }
        fill_gaps(&mut image, &mut known, HALF_GAP);
        assert_eq!(image.get(17, 30), Some(&[90, 120, 200]));
        assert_eq!(image.get(51, 30), Some(&[0; 3]));
        assert_eq!(image.get(42, 30), Some(&[0; 3]), "a wide gap keeps its border");
    }
}
