//! Light, colours and the marks of cameras.

use super::params::AugmentParams;
use crate::jpeg::through_jpeg;
use image::ImageError;
use nalgebra::{Matrix3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use stonewise_core::raster::{Raster, RgbImage};
use stonewise_core::statistics::normal_pair;

/// Qualities of JPEG files, from and to.
const JPEG_QUALITY: [f64; 2] = [35.0, 95.0];
/// Share of light that shadows leave, from and to, and the width of their borders in parts of the image.
const SHADOW: [f64; 2] = [0.35, 0.8];
const SHADOW_BORDER: [f64; 2] = [0.01, 0.15];

/// The image in another light, by another camera.
pub fn recolour(image: &RgbImage, params: &AugmentParams, rng: &mut ChaCha8Rng) -> RgbImage {
    let size = [image.width(), image.height()];
    let map = ColourMap::random(params, rng);
    let shadow = (rng.random::<f64>() < params.shadow_share).then(|| Shadow::random(rng));
    let mut pixels: Vec<[f64; 3]> = image.data().iter().map(|&p| map.apply(p)).collect();
    if let Some(shadow) = shadow {
        for (index, pixel) in pixels.iter_mut().enumerate() {
            let at = [index % size[0] as usize, index / size[0] as usize];
            let light = shadow.light([0, 1].map(|i| at[i] as f64 / f64::from(size[i])));
            *pixel = pixel.map(|v| v * light);
        }
    }
    if rng.random::<f64>() < params.blurred_share {
        blur(&mut pixels, size, rng.random::<f64>() * params.blur_px);
    }
    let noise = rng.random::<f64>().powi(2) * params.noise;
    let byte = |value: f64, rng: &mut ChaCha8Rng| {
        ((value + noise * normal_pair([rng.random(), rng.random()])[0]) * 255.0).round() as u8
    };
    let bytes = pixels.iter().map(|p| p.map(|v| byte(v, rng))).collect();
    let image = Raster::from_vec(size[0], size[1], bytes).unwrap_or_else(|| image.clone());
    if rng.random::<f64>() < params.jpeg_share {
        let quality = between(rng, JPEG_QUALITY) as u8;
        // Sizes that JPEG cannot hold stay as they are.
        return compress(&image, quality).unwrap_or(image);
    }
    image
}

fn between(rng: &mut ChaCha8Rng, [low, high]: [f64; 2]) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// Brightness, contrast, and a linear map of colours; values from 0 to 1.
struct ColourMap {
    matrix: Matrix3<f64>,
    contrast: f64,
}

/// Luminance and two colour differences (YIQ, NTSC 1953).
const YIQ_FROM_RGB: [f64; 9] = [0.299, 0.587, 0.114, 0.596, -0.274, -0.322, 0.211, -0.523, 0.312];

impl ColourMap {
    fn random(params: &AugmentParams, rng: &mut ChaCha8Rng) -> Self {
        let mut factor = |stops: f64| (stops * between(rng, [-1.0, 1.0])).exp2();
        let (brightness, contrast) = (factor(params.brightness), factor(params.contrast));
        let saturation = factor(params.saturation);
        let light = Vector3::from([(); 3].map(|()| factor(params.white_balance)));
        let (sin, cos) = (between(rng, [-1.0, 1.0]) * params.hue_deg.to_radians()).sin_cos();
        let (sin, cos) = (saturation * sin, saturation * cos);
        let turn = Matrix3::new(1.0, 0.0, 0.0, 0.0, cos, -sin, 0.0, sin, cos);
        let yiq = Matrix3::from_row_slice(&YIQ_FROM_RGB);
        let rgb = yiq.try_inverse().unwrap_or_else(Matrix3::identity);
        Self {
            matrix: Matrix3::from_diagonal(&(brightness * light)) * rgb * turn * yiq,
            contrast,
        }
    }

    fn apply(&self, pixel: [u8; 3]) -> [f64; 3] {
        let colour = self.matrix * Vector3::from(pixel.map(|v| f64::from(v) / 255.0));
        let stretched = colour.map(|v| 0.5 + self.contrast * (v - 0.5));
        [stretched.x, stretched.y, stretched.z].map(|v| v.clamp(0.0, 1.0))
    }
}

/// The shadow of something large: what lies beyond a straight border is darker.
struct Shadow {
    point: [f64; 2],
    normal: [f64; 2],
    border: f64,
    left: f64,
}

impl Shadow {
    fn random(rng: &mut ChaCha8Rng) -> Self {
        let angle = between(rng, [0.0, std::f64::consts::TAU]);
        Self {
            point: [rng.random(), rng.random()],
            normal: [angle.cos(), angle.sin()],
            border: between(rng, SHADOW_BORDER),
            left: between(rng, SHADOW),
        }
    }

    /// Share of the light at a place, image coordinates from 0 to 1.
    fn light(&self, at: [f64; 2]) -> f64 {
        let depth = (at[0] - self.point[0]) * self.normal[0] + (at[1] - self.point[1]) * self.normal[1];
        1.0 - (1.0 - self.left) * (depth / self.border).clamp(0.0, 1.0)
    }
}

/// Gaussian blur, rows first; places outside have the colour of the border.
fn blur(pixels: &mut [[f64; 3]], [width, height]: [u32; 2], sigma_px: f64) {
    let radius = (3.0 * sigma_px).ceil() as i64;
    let weight = |d: i64| (-0.5 * (d as f64 / sigma_px.max(1e-6)).powi(2)).exp();
    let total: f64 = (-radius..=radius).map(weight).sum();
    for [count, length, step, stride] in [[height, width, 1, width], [width, height, width, 1]] {
        for line in 0..count as usize {
            let at = |i: i64| {
                let place = i.clamp(0, i64::from(length) - 1) as usize;
                line * stride as usize + place * step as usize
            };
            let old: Vec<[f64; 3]> = (0..i64::from(length)).map(|i| pixels[at(i)]).collect();
            for i in 0..i64::from(length) {
                let mut sum = [0.0; 3];
                for d in -radius..=radius {
                    let source = old[(i + d).clamp(0, i64::from(length) - 1) as usize];
                    let w = weight(d) / total;
                    sum = [0, 1, 2].map(|c| sum[c] + w * source[c]);
                }
                pixels[at(i)] = sum;
            }
        }
    }
}

fn compress(image: &RgbImage, quality: u8) -> Result<RgbImage, ImageError> {
    let (width, height) = (image.width(), image.height());
    let pixels = through_jpeg(image.data(), [width, height], quality)?;
    Ok(Raster::from_vec(width, height, pixels).unwrap_or_else(|| image.clone()))
}
