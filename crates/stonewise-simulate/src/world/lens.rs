//! From light to a picture: blur, vignetting, exposure, sensor noise, tone curve.

use crate::world::noise::normal;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use stonewise_core::raster::{Raster, srgb_from_linear};

/// Lens and sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorParams {
    /// Blur of lens and motion, standard deviation, pixels.
    pub blur_px: f64,
    /// Loss of light in the corners, 0..1.
    pub vignetting: f64,
    /// Spread of the exposure from photo to photo, natural logarithm.
    pub exposure_spread: f64,
    /// Electrons that a full pixel holds: photon noise is their square root.
    pub full_well: f64,
    /// Read-out noise, electrons.
    pub read_noise: f64,
}

impl Default for SensorParams {
    fn default() -> Self {
        Self {
            blur_px: 0.6,
            vignetting: 0.22,
            exposure_spread: 0.1,
            full_well: 6000.0,
            read_noise: 9.0,
        }
    }
}

/// Develops linear light into an 8-bit sRGB picture. `meter`: mean light that becomes middle grey.
///
/// The bytes are equal for any number of threads: every row has random numbers of its own.
pub(super) fn develop(
    light: &Raster<[f32; 3]>,
    meter: f64,
    params: &SensorParams,
    seed: u64,
) -> Raster<[u8; 3]> {
    let (width, height) = (light.width() as usize, light.height() as usize);
    let blurred = blur(light.data(), width, height, params.blur_px);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let gain = 0.17 / meter.max(1e-9) * (params.exposure_spread * normal(&mut rng)).exp();
    let radius2 = 0.25 * (width * width + height * height) as f64;
    let mut picture = Raster::filled(light.width(), light.height(), [0u8; 3]);
    picture
        .data_mut()
        .par_chunks_mut(width)
        .enumerate()
        .for_each(|(y, row)| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(y as u64 + 1);
            for (x, pixel) in row.iter_mut().enumerate() {
                let (dx, dy) = (
                    x as f64 + 0.5 - 0.5 * width as f64,
                    y as f64 + 0.5 - 0.5 * height as f64,
                );
                let fall = 1.0 - params.vignetting * (dx * dx + dy * dy) / radius2;
                for (c, value) in pixel.iter_mut().enumerate() {
                    let electrons = f64::from(blurred[y * width + x][c]) * gain * fall * params.full_well;
                    let noise = (electrons.max(0.0) + params.read_noise.powi(2)).sqrt() * normal(&mut rng);
                    *value = tone((electrons + noise) / params.full_well);
                }
            }
        });

    picture
}

/// sRGB with a soft shoulder, as cameras apply it, to 8 bits.
fn tone(linear: f64) -> u8 {
    let x = linear.max(0.0);
    // Straight up to 0.5, then bent so that light of 2 is white.
    let x = if x < 0.5 {
        x
    } else {
        0.5 + 0.5 * (1.0 - (-(x - 0.5) / 0.5).exp())
    };
    (255.0 * srgb_from_linear(x) + 0.5).clamp(0.0, 255.0) as u8
}

fn blur(data: &[[f32; 3]], width: usize, height: usize, sigma: f64) -> Vec<[f32; 3]> {
    if sigma <= 0.0 {
        return data.to_vec();
    }
    let reach = (3.0 * sigma).ceil() as isize;
    let weights: Vec<f64> = (-reach..=reach)
        .map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp())
        .collect();
    let total: f64 = weights.iter().sum();
    let weights: Vec<f32> = weights.iter().map(|w| (w / total) as f32).collect();

    let pass = |input: &[[f32; 3]], dx: isize, dy: isize| -> Vec<[f32; 3]> {
        (0..height)
            .into_par_iter()
            .flat_map_iter(|y| {
                let weights = &weights;
                (0..width).map(move |x| {
                    let mut sum = [0.0f32; 3];
                    for (k, w) in weights.iter().enumerate() {
                        let k = k as isize - reach;
                        let sx = (x as isize + k * dx).clamp(0, width as isize - 1) as usize;
                        let sy = (y as isize + k * dy).clamp(0, height as isize - 1) as usize;
                        for (s, v) in sum.iter_mut().zip(input[sy * width + sx]) {
                            *s += w * v;
                        }
                    }
                    sum
                })
            })
            .collect()
    };

    pass(&pass(data, 1, 0), 0, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_field_becomes_middle_grey_with_the_stated_noise() {
        let light = Raster::filled(200, 100, [3.0f32; 3]);
        let params = SensorParams {
            vignetting: 0.0,
            exposure_spread: 0.0,
            ..SensorParams::default()
        };
        let picture = develop(&light, 3.0, &params, 1);
        let values: Vec<f64> = picture.data().iter().map(|p| f64::from(p[1])).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        // sRGB of 0.17 is 114.8.
        assert!((mean - 114.8).abs() < 0.7, "{mean}");
        let sd = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
        // 1020 electrons: 33.2 of noise with read-out, and sRGB has a slope of 0.447 * 1.055 / 2.4... there.
        let slope = 255.0 * 1.055 / 2.4 * 0.17f64.powf(1.0 / 2.4 - 1.0);
        let stated = slope * (1020.0f64 + 81.0).sqrt() / 6000.0;
        assert!((sd / stated - 1.0).abs() < 0.1, "{sd} against {stated}");
    }
}
