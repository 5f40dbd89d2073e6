//! From light to a photo's bytes: blur, exposure, sensor noise, tone curve, sharpening, JPEG.

use super::draw::{Rng, between, chance, log_between, normal, sometimes};
use crate::jpeg::through_jpeg;
use rand::RngExt;
use stonewise_core::raster::srgb_from_linear;

/// Entries of the tone curve's table, over the square root of the light.
const TONES: usize = 1024;

/// What camera and file format do to a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Mean of the photo after exposure, linear, 0.03 (dark) to 0.65 (washed out).
    pub exposure: f32,
    /// Gains of red, green and blue, 0.7 to 1.4.
    pub white_balance: [f32; 3],
    /// Standard deviation of the blur, pixels, 0.3 to 2.5.
    pub blur_px: f32,
    /// Length of the path that the image moved during exposure along x and y, pixels, up to 4.
    pub motion_px: [f32; 2],
    /// Strength of sharpening, 0 to 1.2.
    pub sharpen: f32,
    /// Light lost in the corners, 0 to 0.5.
    pub vignetting: f32,
    /// Slope of the tone curve at its middle over that of sRGB, 0.7 to 1.6.
    pub contrast: f32,
    /// Light scattered over the whole photo, in parts of its mean, 0 to 0.3.
    pub haze: f32,
    /// Standard deviation of sensor noise at middle brightness, 0 to 0.05 (linear, of full scale).
    pub noise: f32,
    /// JPEG quality, 25 to 98; `None` without compression.
    pub jpeg_quality: Option<u8>,
}

impl Camera {
    /// A camera drawn at random, mostly decent; its blur leaves stones of `stone_px` pixels to be seen.
    pub(super) fn random(stone_px: f32, rng: &mut Rng) -> Self {
        let tint = between(rng, 0.0, 0.06);
        // From blue to amber, as by a wrong colour temperature.
        let warmth = 0.1 * normal(rng);
        let moving = chance(rng, 0.12);
        let most_blur_px = (0.04 * stone_px).clamp(0.5, 2.5);
        Self {
            exposure: log_between(rng, 0.04, 0.6),
            white_balance: [warmth, 0.0, -warmth]
                .map(|gain| (gain + tint * normal(rng)).exp().clamp(0.7, 1.4)),
            blur_px: if chance(rng, 0.75) {
                between(rng, 0.3, 0.9)
            } else {
                between(rng, 0.9, 2.5)
            }
            .min(most_blur_px),
            motion_px: [0, 1].map(|_| {
                if moving {
                    between(rng, -1.6, 1.6) * most_blur_px
                } else {
                    0.0
                }
            }),
            sharpen: sometimes(rng, 0.4, 0.1, 1.2),
            vignetting: sometimes(rng, 0.3, 0.05, 0.5),
            contrast: log_between(rng, 0.7, 1.6),
            haze: sometimes(rng, 0.25, 0.02, 0.3),
            noise: log_between(rng, 0.001, 0.05),
            jpeg_quality: chance(rng, 0.75).then(|| between(rng, 25.0, 98.0) as u8),
        }
    }

    /// Develops the light on a canvas of `width` x `height` samples, `scale` to a pixel, to a photo.
    ///
    /// Compression is left out where JPEG cannot hold the photo (more than 65535 pixels along a side).
    pub(super) fn develop(
        &self,
        radiance: Vec<[f32; 3]>,
        canvas: [usize; 2],
        scale: f32,
        photo: [u32; 2],
        rng: &mut Rng,
    ) -> Vec<[u8; 3]> {
        let blurred = self.blur(radiance, canvas, scale);
        let mut light = sample(&blurred, canvas, scale, photo);
        self.expose(&mut light, photo, rng);
        let pixels = self.tones(&light);
        let pixels = if self.sharpen > 0.0 {
            sharpened(&pixels, photo, self.sharpen)
        } else {
            pixels
        };
        match self.jpeg_quality {
            Some(quality) => through_jpeg(&pixels, photo, quality).unwrap_or(pixels),
            None => pixels,
        }
    }

    fn blur(&self, radiance: Vec<[f32; 3]>, [width, height]: [usize; 2], scale: f32) -> Vec<[f32; 3]> {
        // A box as wide as the path has a twelfth of its square as variance.
        let deviation = |motion: f32| {
            let variance = self.blur_px * self.blur_px + motion * motion / 12.0;
            scale * variance.sqrt()
        };
        let across = blur_rows(&radiance, width, &gaussian(deviation(self.motion_px[0])));
        blur_columns(&across, width, height, &gaussian(deviation(self.motion_px[1])))
    }

    /// Applies exposure, vignetting, haze, white balance and noise.
    fn expose(&self, light: &mut [[f32; 3]], [width, height]: [u32; 2], rng: &mut Rng) {
        // The square of the mean root, so that a bright sky does not leave the wall black.
        let root = light.iter().map(|p| (p[0] + p[1] + p[2]).sqrt()).sum::<f32>() / light.len().max(1) as f32;
        let gain = self.exposure / (root * root / 3.0).max(1e-4);
        let veil = self.haze * self.exposure;
        let (cx, cy) = (0.5 * width as f32, 0.5 * height as f32);
        let corner = (cx * cx + cy * cy).max(1.0);
        // Shot noise grows with the root of the light; both parts are equal at a light of 0.05.
        let shot = self.noise / 0.25f32.sqrt();
        for (i, pixel) in light.iter_mut().enumerate() {
            let (x, y) = ((i % width as usize) as f32 - cx, (i / width as usize) as f32 - cy);
            let fall = 1.0 - self.vignetting * (x * x + y * y) / corner;
            let noise = noise3(rng);
            for c in 0..3 {
                let value = (gain * fall * pixel[c] + veil) * self.white_balance[c];
                let sigma = shot * (value.max(0.0) + 0.02).sqrt() * 0.9;
                pixel[c] = value + sigma * noise[c];
            }
        }
    }

    fn tones(&self, light: &[[f32; 3]]) -> Vec<[u8; 3]> {
        let table: Vec<u8> = (0..TONES)
            .map(|i| {
                let root = i as f32 / (TONES - 1) as f32;
                let value = srgb_from_linear(root * root);
                // A sigmoid about the middle for more contrast, a straight line for less.
                let bent = if self.contrast > 1.0 {
                    let (a, b) = (value.powf(self.contrast), (1.0 - value).powf(self.contrast));
                    a / (a + b).max(1e-6)
                } else {
                    0.5 + (value - 0.5) * self.contrast
                };
                (255.0 * bent + 0.5) as u8
            })
            .collect();
        light
            .iter()
            .map(|pixel| pixel.map(|c| table[(c.clamp(0.0, 1.0).sqrt() * (TONES - 1) as f32 + 0.5) as usize]))
            .collect()
    }
}

/// Three numbers of mean 0 and deviation 1, nearly normal: each the sum of four uniform bytes.
fn noise3(rng: &mut Rng) -> [f32; 3] {
    let bits: [u64; 2] = [rng.random(), rng.random()];
    let sum = |word: u64| {
        let bytes = word.to_le_bytes();
        let total: u32 = bytes[..4].iter().map(|&b| u32::from(b)).sum();
        (total as f32 - 510.0) / 147.8
    };
    [sum(bits[0]), sum(bits[0] >> 32), sum(bits[1])]
}

/// Weights of a Gaussian, from its middle outwards.
fn gaussian(deviation: f32) -> Vec<f32> {
    let radius = (2.5 * deviation).ceil().max(1.0) as usize;
    let weights: Vec<f32> = (0..=radius)
        .map(|k| (-0.5 * (k as f32 / deviation.max(1e-3)).powi(2)).exp())
        .collect();
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f32>();
    weights.iter().map(|w| w / total).collect()
}

fn blur_rows(image: &[[f32; 3]], width: usize, weights: &[f32]) -> Vec<[f32; 3]> {
    let radius = weights.len() - 1;
    let mut padded = vec![[0.0; 3]; width + 2 * radius];
    let mut blurred = vec![[0.0; 3]; image.len()];
    for (row, out) in image.chunks_exact(width).zip(blurred.chunks_exact_mut(width)) {
        padded[..radius].fill(row[0]);
        padded[radius..radius + width].copy_from_slice(row);
        padded[radius + width..].fill(row[width - 1]);
        let (source, target) = (padded.as_flattened(), out.as_flattened_mut());
        for (k, &weight) in weights.iter().enumerate() {
            let before = &source[3 * (radius - k)..3 * (radius - k + width)];
            let after = &source[3 * (radius + k)..3 * (radius + k + width)];
            if k == 0 {
                add(target, before, weight);
            } else {
                add(target, before, weight);
                add(target, after, weight);
            }
        }
    }
    blurred
}

fn blur_columns(image: &[[f32; 3]], width: usize, height: usize, weights: &[f32]) -> Vec<[f32; 3]> {
    let mut blurred = vec![[0.0; 3]; image.len()];
    let row = |y: usize| image[y * width..(y + 1) * width].as_flattened();
    for (y, out) in blurred.chunks_exact_mut(width).enumerate() {
        let target = out.as_flattened_mut();
        for (k, &weight) in weights.iter().enumerate() {
            add(target, row(y.saturating_sub(k)), weight);
            if k > 0 {
                add(target, row((y + k).min(height - 1)), weight);
            }
        }
    }
    blurred
}

fn add(target: &mut [f32], source: &[f32], weight: f32) {
    for (t, s) in target.iter_mut().zip(source) {
        *t += weight * s;
    }
}

/// Bilinear samples at the photo's pixel centres.
fn sample(image: &[[f32; 3]], [width, height]: [usize; 2], scale: f32, photo: [u32; 2]) -> Vec<[f32; 3]> {
    let place = |pixel: u32, count: usize| {
        let at = ((pixel as f32 + 0.5) * scale - 0.5).clamp(0.0, (count - 1) as f32);
        let low = at as usize;
        (low, (low + 1).min(count - 1), at - low as f32)
    };
    let mut sampled = Vec::with_capacity(photo[0] as usize * photo[1] as usize);
    for y in 0..photo[1] {
        let (y0, y1, fy) = place(y, height);
        for x in 0..photo[0] {
            let (x0, x1, fx) = place(x, width);
            let value = |c: usize| {
                let top = image[y0 * width + x0][c] * (1.0 - fx) + image[y0 * width + x1][c] * fx;
                let bottom = image[y1 * width + x0][c] * (1.0 - fx) + image[y1 * width + x1][c] * fx;
                top * (1.0 - fy) + bottom * fy
            };
            sampled.push([value(0), value(1), value(2)]);
        }
    }
    sampled
}

/// Unsharp mask with the mean of the four neighbours.
fn sharpened(pixels: &[[u8; 3]], [width, height]: [u32; 2], strength: f32) -> Vec<[u8; 3]> {
    let (width, height) = (width as usize, height as usize);
    (0..pixels.len())
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let neighbours = [
                y * width + x.saturating_sub(1),
                y * width + (x + 1).min(width - 1),
                y.saturating_sub(1) * width + x,
                (y + 1).min(height - 1) * width + x,
            ];
            [0, 1, 2].map(|c: usize| {
                let here = f32::from(pixels[i][c]);
                let around: f32 = neighbours.iter().map(|&n| f32::from(pixels[n][c])).sum();
                (here + strength * (here - 0.25 * around) + 0.5) as u8
            })
        })
        .collect()
}
