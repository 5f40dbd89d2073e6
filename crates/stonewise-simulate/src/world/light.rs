//! Sun, sky and what reaches each place of the wall.

use crate::world::face::FacePoint;
use crate::world::noise::Noise;
use crate::world::scene::Scene;
use nalgebra::Vector3;
use rayon::prelude::*;

/// The light of one epoch; colours are linear red, green, blue.
#[derive(Clone, Debug)]
pub struct Light {
    /// Unit vector to the sun.
    pub sun: Vector3<f64>,
    /// Light of the sun on a surface that faces it.
    pub sun_rgb: [f64; 3],
    /// Light of the whole sky.
    pub sky_rgb: [f64; 3],
    /// Light that the ground sends back up.
    pub ground_rgb: [f64; 3],
}

impl Light {
    /// A day by seed: the sun somewhere in front of the wall, more or less veiled.
    pub fn of_day(seed: u64) -> Self {
        let draw = Noise::new(seed, 50);
        let azimuth = (draw.uniform(0) - 0.5) * 2.0;
        let elevation = 0.5 + 0.5 * draw.uniform(1);
        let clear = 0.35 + 0.65 * draw.uniform(2);
        Self {
            sun: Vector3::new(
                azimuth.cos() * elevation.cos(),
                azimuth.sin() * elevation.cos(),
                elevation.sin(),
            ),
            sun_rgb: [2.6, 2.35, 2.0].map(|c| c * clear),
            sky_rgb: [0.62, 0.74, 0.92].map(|c| c * (1.3 - 0.5 * clear)),
            ground_rgb: [0.17, 0.16, 0.10],
        }
    }

    /// The light of the day without sun, under a sky that is brighter for its clouds.
    pub fn overcast(&self) -> Self {
        Self {
            sun_rgb: [0.0; 3],
            sky_rgb: [1.1, 1.15, 1.2],
            ..self.clone()
        }
    }

    /// Light on a matt surface with this normal, as red, green, blue. `lit`: share of the sun that reaches
    /// it; `open`: share of its sky that nothing hides.
    pub fn on(&self, normal: &Vector3<f64>, lit: f64, open: f64) -> [f64; 3] {
        let sun = lit * normal.dot(&self.sun).max(0.0);
        let up = 0.5 + 0.5 * normal.z;
        std::array::from_fn(|c| {
            self.sun_rgb[c] * sun + open * (self.sky_rgb[c] * up + self.ground_rgb[c] * (1.0 - up))
        })
    }
}

/// Sun and open sky on the wall, worked out once for all photos of an epoch.
pub struct LightMap {
    origin: [f64; 2],
    size: [usize; 2],
    /// Share of the sun, share of the sky.
    cells: Vec<[f32; 2]>,
}

const CELL_M: f64 = 0.005;

impl LightMap {
    /// Sends a ray to the sun from every 5 mm of the face, and compares heights for the sky.
    pub fn new(scene: &Scene, light: &Light) -> Self {
        let w = scene.window();
        let size = [0, 2].map(|i| ((w[i + 1] - w[i]) / CELL_M) as usize + 1);
        let origin = [w[0], w[2]];
        let found: Vec<(f32, f32)> = (0..size[0] * size[1])
            .into_par_iter()
            .map(|k| {
                let a = origin[0] + ((k % size[0]) as f64 + 0.5) * CELL_M;
                let u = origin[1] + ((k / size[0]) as f64 + 0.5) * CELL_M;
                scene.on_face(a, u).map_or((0.0, 1.0), |hit| {
                    let start = hit.point + hit.normal * 0.002;
                    let height = scene.wall().face.face_of(&hit.point).n;
                    let lit = hit.normal.dot(&light.sun) > 0.0 && !scene.blocked(&start, &light.sun, 20.0);
                    (height as f32, f32::from(u8::from(lit)))
                })
            })
            .collect();
        let heights: Vec<f32> = found.iter().map(|f| f.0).collect();
        let [near, far] = [3, 11].map(|radius| box_mean(&heights, size, radius));
        let cells = (0..heights.len())
            .map(|k| {
                // A place that lies under its surroundings sees less sky.
                let under = 14.0 * (near[k] - heights[k]).max(0.0) + 9.0 * (far[k] - heights[k]).max(0.0);
                [found[k].1, (1.0 / (1.0 + under)).clamp(0.25, 1.0)]
            })
            .collect();
        Self { origin, size, cells }
    }

    /// Share of the sun and share of the sky at a place on the face, bilinear between cells.
    pub fn at(&self, f: &FacePoint) -> [f64; 2] {
        let g = |v: f64, axis: usize| {
            ((v - self.origin[axis]) / CELL_M - 0.5).clamp(0.0, self.size[axis] as f64 - 1.001)
        };
        let (gx, gy) = (g(f.a, 0), g(f.u, 1));
        let (i, j) = (gx as usize, gy as usize);
        let (fx, fy) = (gx - i as f64, gy - j as f64);
        let k = j * self.size[0] + i;
        std::array::from_fn(|c| {
            let v = |k: usize| f64::from(self.cells[k.min(self.cells.len() - 1)][c]);
            let low = v(k) + (v(k + 1) - v(k)) * fx;
            let high = v(k + self.size[0]) + (v(k + self.size[0] + 1) - v(k + self.size[0])) * fx;
            low + (high - low) * fy
        })
    }
}

/// Mean over a square of `2 radius + 1` cells, cut off at the border.
fn box_mean(values: &[f32], size: [usize; 2], radius: usize) -> Vec<f32> {
    let rows = sliding_mean(values, size[0], size[1], 1, size[0], radius);
    sliding_mean(&rows, size[1], size[0], size[0], 1, radius)
}

/// Mean along lines of `length` values that lie `step` apart; there are `lines` of them, `line_step` apart.
fn sliding_mean(
    values: &[f32],
    length: usize,
    lines: usize,
    step: usize,
    line_step: usize,
    radius: usize,
) -> Vec<f32> {
    let mut means = vec![0.0; values.len()];
    for line in 0..lines {
        let at = |i: usize| line * line_step + i * step;
        let mut prefix = vec![0.0f64; length + 1];
        for i in 0..length {
            prefix[i + 1] = prefix[i] + f64::from(values[at(i)]);
        }
        for i in 0..length {
            let (from, to) = (i.saturating_sub(radius), (i + radius + 1).min(length));
            means[at(i)] = ((prefix[to] - prefix[from]) / (to - from) as f64) as f32;
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn box_means_agree_with_sums_by_hand() {
        let size = [7, 5];
        let values: Vec<f32> = (0..35).map(|k| ((k * 13) % 17) as f32).collect();
        let means = box_mean(&values, size, 2);
        for y in 0..5usize {
            for x in 0..7usize {
                let (mut sum, mut count) = (0.0, 0.0);
                for j in y.saturating_sub(2)..(y + 3).min(5) {
                    for i in x.saturating_sub(2)..(x + 3).min(7) {
                        sum += values[j * 7 + i];
                        count += 1.0;
                    }
                }
                assert!((means[y * 7 + x] - sum / count).abs() < 1e-4);
            }
        }
    }
}
