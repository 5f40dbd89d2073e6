//! The part of a wall that is worked on, sampled once for millions of rays.

use crate::world::noise::Row;
use crate::world::wall::Wall;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Sample distance of a stone's face, metres: between samples the surface is bilinear, and that surface is
/// the truth.
const STONE_STEP_M: f64 = 0.0025;
/// Sample distance of the mortar, metres.
const MORTAR_STEP_M: f64 = 0.004;

/// Heights on a regular grid, bilinear in between.
#[derive(Clone, Debug)]
pub struct HeightGrid {
    origin: [f64; 2],
    step_m: f64,
    size: [usize; 2],
    heights: Vec<f32>,
}

impl HeightGrid {
    /// Samples heights over smallest x, largest x, smallest y, largest y; `heights` says those of a row.
    fn sample(extent: [f64; 4], step_m: f64, heights: impl Fn(Row, &mut [f64]) + Sync) -> Self {
        let size = [0, 2].map(|i| ((extent[i + 1] - extent[i]) / step_m).ceil() as usize + 2);
        let mut all = vec![0.0f32; size[0] * size[1]];
        all.par_chunks_mut(size[0])
            .enumerate()
            .for_each_init(Vec::new, |row, (j, kept)| {
                row.resize(size[0], 0.0);
                let places = Row {
                    x: extent[0],
                    y: extent[2] + j as f64 * step_m,
                    step: step_m,
                };
                heights(places, row);
                for (k, v) in kept.iter_mut().zip(row.iter()) {
                    *k = *v as f32;
                }
            });
        Self {
            origin: [extent[0], extent[2]],
            step_m,
            size,
            heights: all,
        }
    }

    /// Height at (x, y), metres; `None` outside the grid.
    #[inline]
    pub fn height(&self, x: f64, y: f64) -> Option<f64> {
        let gx = (x - self.origin[0]) / self.step_m;
        let gy = (y - self.origin[1]) / self.step_m;
        if gx < 0.0 || gy < 0.0 {
            return None;
        }
        let (i, j) = (gx as usize, gy as usize);
        if i + 1 >= self.size[0] || j + 1 >= self.size[1] {
            return None;
        }
        let (fx, fy) = (gx - i as f64, gy - j as f64);
        let k = j * self.size[0] + i;
        let h = |k: usize| f64::from(self.heights[k]);
        let low = h(k) + (h(k + 1) - h(k)) * fx;
        let high = h(k + self.size[0]) + (h(k + self.size[0] + 1) - h(k + self.size[0])) * fx;
        Some(low + (high - low) * fy)
    }

    /// Outward unit normal at (x, y), from central differences over two samples.
    pub fn normal(&self, x: f64, y: f64) -> Vector3<f64> {
        let d = self.step_m;
        let slope = |p: Option<f64>, q: Option<f64>| match (p, q) {
            (Some(p), Some(q)) => ((q - p) / (2.0 * d)).clamp(-4.0, 4.0),
            _ => 0.0,
        };
        let sx = slope(self.height(x - d, y), self.height(x + d, y));
        let sy = slope(self.height(x, y - d), self.height(x, y + d));
        Vector3::new(-sx, -sy, 1.0).normalize()
    }

    /// Largest height.
    pub(super) fn top(&self) -> f64 {
        f64::from(self.heights.iter().copied().fold(f32::MIN, f32::max))
    }
}

/// The faces of the stones that reach into a window of the wall, and the mortar there.
///
/// Memory: about 0.9 MB a square metre. A wall larger than memory is worked on window by window.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Which stones of the wall, ascending, with their faces in their own frames.
    pub stones: Vec<(usize, Arc<HeightGrid>)>,
    /// Mortar over face coordinates, first epoch.
    pub mortar: HeightGrid,
    /// The window: smallest a, largest a, smallest u, largest u, metres.
    pub window: [f64; 4],
    /// Largest height of any stone over the idealised face, metres.
    pub top_m: f64,
}

/// Faces of stones that were sampled for one window and may be needed for the next.
#[derive(Clone, Debug, Default)]
pub struct SampledFaces(BTreeMap<usize, Arc<HeightGrid>>);

impl Surface {
    /// Samples the wall in a window; the same for any number of threads. Faces that `sampled` holds are taken
    /// from there; it is left with those of this window alone.
    pub fn new(wall: &Wall, window: [f64; 4], sampled: &mut SampledFaces) -> Self {
        let reaches =
            |b: &[f64; 4]| b[0] <= window[1] && b[1] >= window[0] && b[2] <= window[3] && b[3] >= window[2];
        let inside: Vec<usize> = (0..wall.stones.len())
            .filter(|&i| reaches(&wall.stones[i].bounds))
            .collect();
        let known = &sampled.0;
        let stones: Vec<(usize, Arc<HeightGrid>)> = inside
            .into_par_iter()
            .map(|i| {
                let face = known.get(&i).cloned();
                (i, face.unwrap_or_else(|| Arc::new(stone_grid(wall, i))))
            })
            .collect();
        sampled.0 = stones.iter().cloned().collect();
        let margin = 0.3;
        let around = [
            window[0] - margin,
            window[1] + margin,
            window[2] - margin,
            window[3] + margin,
        ];
        let top_m = stones.iter().map(|(_, g)| g.top()).fold(0.0, f64::max);
        Self {
            stones,
            mortar: HeightGrid::sample(around, MORTAR_STEP_M, |row, out| wall.mortar_heights(row, out)),
            window,
            top_m,
        }
    }
}

fn stone_grid(wall: &Wall, i: usize) -> HeightGrid {
    let stone = &wall.stones[i];
    let margin = 0.02;
    let [a0, a1, u0, u1] = stone.bounds;
    let local = [
        a0 - margin - stone.middle[0],
        a1 + margin - stone.middle[0],
        u0 - margin - stone.middle[1],
        u1 + margin - stone.middle[1],
    ];
    HeightGrid::sample(local, STONE_STEP_M, |row, out| {
        let waves = [0, 1].map(|axis| {
            let mut wave = vec![0.0; out.len()];
            wall.waves(axis, row.moved(stone.middle[0], stone.middle[1], 1.0), &mut wave);
            wave
        });
        wall.stone_heights(i, row, waves.each_ref().map(Vec::as_slice), out);
    })
}
