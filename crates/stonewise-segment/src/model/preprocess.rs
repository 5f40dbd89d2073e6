//! From photos to the model's input.

use super::config::{MaskRcnnConfig, Resize};
use crate::engine::Tensor;
use crate::relief::resampled;
use rayon::prelude::*;
use stonewise_core::raster::{RELIEF_CHANNELS, ReliefMap, RgbImage};

/// Sides of the model's input are multiples of this: the stride of the coarsest features.
const STRIDE: usize = 32;

/// Size of an image at the model's input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Columns and rows without padding.
    pub size: [usize; 2],
    /// Model pixels per pixel, along columns and rows.
    pub scale: [f32; 2],
}

impl Seen {
    /// Size and scale of an image.
    pub fn new(image: &RgbImage, resize: Option<Resize>) -> Self {
        let original = [image.width() as usize, image.height() as usize];
        let Some(resize) = resize else {
            return Self {
                size: original,
                scale: [1.0; 2],
            };
        };
        let shorter = original[0].min(original[1]) as f64;
        let longer = original[0].max(original[1]) as f64;
        let scale = (resize.shorter as f64 / shorter).min(resize.longest as f64 / longer);
        let size = original.map(|side| ((side as f64 * scale) as usize).max(1));
        Self {
            size,
            scale: [0, 1].map(|axis| size[axis] as f32 / original[axis] as f32),
        }
    }

    /// Columns and rows as floats.
    pub fn extent(&self) -> [f32; 2] {
        self.size.map(|side| side as f32)
    }
}

/// Images [batch, 3, rows, columns] with zero mean and unit spread, enlarged with zeros to a common size.
pub fn batch(images: &[&RgbImage], seen: &[Seen], config: &MaskRcnnConfig) -> Tensor {
    let common = |axis: usize| {
        let longest = seen.iter().map(|seen| seen.size[axis]).max().unwrap_or(1);
        longest.next_multiple_of(STRIDE).max(STRIDE)
    };
    let [width, height] = [common(0), common(1)];
    let mut values = vec![0.0f32; images.len() * 3 * height * width];
    values
        .par_chunks_mut(height * width)
        .enumerate()
        .for_each(|(plane, values)| {
            let (image, channel) = (plane / 3, plane % 3);
            let normalise =
                |value: f32| (value / 255.0 - config.pixel_mean[channel]) / config.pixel_std[channel];
            fill(values, width, images[image], seen[image].size, channel, normalise);
        });
    Tensor::new([images.len(), 3, height, width], values)
}

/// Relief [batch, channels, rows, columns] of a batch of images padded to `size` (columns, rows), with one column and
/// row for every `step` of the images; zeros where an image has none; `None` where no image has any.
pub fn relief_batch(
    reliefs: &[Option<&ReliefMap>],
    seen: &[Seen],
    size: [usize; 2],
    step: usize,
) -> Option<Tensor> {
    reliefs.iter().flatten().next()?;
    let [width, height] = size.map(|side| side / step);
    let mut values = vec![0.0f32; reliefs.len() * RELIEF_CHANNELS * height * width];
    for ((values, relief), seen) in values
        .chunks_mut(RELIEF_CHANNELS * height * width)
        .zip(reliefs)
        .zip(seen)
    {
        let Some(relief) = relief else { continue };
        let [columns, rows] = seen.size.map(|side| side.div_ceil(step));
        // The last column and row may reach beyond the image.
        let reach = [columns, rows].map(|side| (step * side) as f64);
        let part = [0, 1].map(|axis| reach[axis] / seen.size[axis] as f64);
        let relief = resampled(
            relief,
            [0.0, 0.0, part[0], part[1]],
            [columns as u32, rows as u32],
        );
        for (channel, plane) in values.chunks_mut(height * width).enumerate() {
            for (to, from) in plane.chunks_mut(width).zip(relief.data().chunks(columns)) {
                to.iter_mut().zip(from).for_each(|(to, from)| *to = from[channel]);
            }
        }
    }
    Some(Tensor::new(
        [reliefs.len(), RELIEF_CHANNELS, height, width],
        values,
    ))
}

/// One channel of an image, resampled bilinearly between pixel centres.
fn fill(
    values: &mut [f32],
    stride: usize,
    image: &RgbImage,
    [columns, rows]: [usize; 2],
    channel: usize,
    normalise: impl Fn(f32) -> f32,
) {
    let [width, height] = [image.width() as usize, image.height() as usize];
    let pixels = image.data();
    if [columns, rows] == [width, height] {
        for (values, pixels) in values.chunks_mut(stride).zip(pixels.chunks(width)) {
            for (value, pixel) in values.iter_mut().zip(pixels) {
                *value = normalise(f32::from(pixel[channel]));
            }
        }
        return;
    }

    let xs = neighbours(columns, width);
    for (values, (top, bottom, down)) in values.chunks_mut(stride).zip(neighbours(rows, height)) {
        let row = |y: usize| &pixels[y * width..][..width];
        let (above, below) = (row(top), row(bottom));
        for (value, &(left, right, along)) in values.iter_mut().zip(&xs) {
            let mix = |row: &[[u8; 3]]| {
                let [a, b] = [row[left], row[right]].map(|pixel| f32::from(pixel[channel]));
                a * (1.0 - along) + b * along
            };
            *value = normalise(mix(above) * (1.0 - down) + mix(below) * down);
        }
    }
}

/// The two pixels between which each new pixel's centre lies, and how far towards the second.
fn neighbours(new: usize, old: usize) -> Vec<(usize, usize, f32)> {
    let step = old as f32 / new as f32;
    let place = |at: usize| {
        let at = ((at as f32 + 0.5) * step - 0.5).max(0.0);
        let low = (at as usize).min(old - 1);
        (low, (low + 1).min(old - 1), at - low as f32)
    };
    (0..new).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::raster::Raster;

    fn ramp(width: u32, height: u32) -> RgbImage {
        let pixel = |i: u32| [(2 * (i % width)) as u8, (3 * (i / width)) as u8, 7];
        Raster::from_vec(width, height, (0..width * height).map(pixel).collect()).unwrap()
    }

    #[test]
    fn a_ramp_stays_a_ramp_when_resized() {
        let image = ramp(40, 30);
        let config = MaskRcnnConfig {
            pixel_mean: [0.0; 3],
            pixel_std: [1.0 / 255.0; 3],
            resize: Some(Resize {
                shorter: 60,
                longest: 70,
            }),
            ..MaskRcnnConfig::light()
        };
        let seen = Seen::new(&image, config.resize);
        assert_eq!(seen.size, [70, 52]);
        let tensor = batch(&[&image], &[seen], &config);
        assert_eq!(tensor.shape(), [1, 3, 64, 96]);
        let values = tensor.values();
        let at = |channel: usize, row: usize, column: usize| values[(channel * 64 + row) * 96 + column];
        assert!((at(0, 20, 33) - 2.0 * (33.5 * 40.0 / 70.0 - 0.5)).abs() < 1e-3);
        assert!((at(1, 20, 33) - 3.0 * (20.5 * 30.0 / 52.0 - 0.5)).abs() < 1e-3);
        assert!((at(2, 51, 69) - 7.0).abs() < 1e-3);
        assert_eq!([at(2, 52, 0), at(2, 0, 70)], [0.0, 0.0]);
    }

    #[test]
    fn relief_of_half_the_rows_and_columns_keeps_its_place() {
        // Relief as large as a photo with odd sides; its values are positions in the photo, pixels.
        let pixel = |i: u32| [(i % 51) as f32 + 0.5, (i / 51) as f32 + 0.5, 0.0, 1.0];
        let relief = Raster::from_vec(51, 31, (0..51 * 31).map(pixel).collect()).unwrap();
        let seen = [Seen::new(&ramp(51, 31), None)];
        let tensor = relief_batch(&[Some(&relief)], &seen, [64, 32], 2).unwrap();
        assert_eq!(tensor.shape(), [1, RELIEF_CHANNELS, 16, 32]);
        for (place, value) in tensor.values()[..32 * 16].iter().enumerate() {
            let column = place % 32;
            let expected = if column < 26 {
                (2.0 * column as f32 + 1.0).min(50.5)
            } else {
                0.0
            };
            assert!((value - expected).abs() < 1e-4, "{place}: {value}");
        }
    }
}
