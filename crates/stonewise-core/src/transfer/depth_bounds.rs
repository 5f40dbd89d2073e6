//! Bounds of the depths around the pixels of a depth map, block by block.

use crate::raster::DepthMap;

/// Edge of a block, map pixels: small enough that the depths of an oblique face differ little within it.
const EDGE: usize = 8;

/// The least and the greatest finite depth of each block of a depth map and of the pixels around it.
///
/// Blocks take a thirty-second of the map's memory, so that those of neighbouring points stay in the
/// processor's cache.
pub(super) struct DepthBounds {
    columns: usize,
    /// Row by row; infinity and 0 where no depth is finite.
    blocks: Vec<[f32; 2]>,
}

impl DepthBounds {
    /// `reach`: pixels around each block that belong to it too. Cost: two passes over the map.
    pub(super) fn new(map: &DepthMap, reach: usize) -> Self {
        let (width, height) = (map.width() as usize, map.height() as usize);
        let columns = width.div_ceil(EDGE);
        let mut blocks = Vec::with_capacity(columns * height.div_ceil(EDGE));
        let (mut least, mut greatest) = (vec![0.0; width], vec![0.0; width]);
        for top in (0..height).step_by(EDGE) {
            least.fill(f32::INFINITY);
            greatest.fill(0.0);
            let rows = top.saturating_sub(reach) * width..(top + EDGE + reach).min(height) * width;
            for row in map.data()[rows].chunks_exact(width) {
                for ((low, high), &depth) in least.iter_mut().zip(&mut greatest).zip(row) {
                    *low = least_of(*low, depth);
                    *high = greatest_of(*high, if depth < f32::INFINITY { depth } else { 0.0 });
                }
            }
            blocks.extend((0..width).step_by(EDGE).map(|left| {
                let around = left.saturating_sub(reach)..(left + EDGE + reach).min(width);
                let low = least[around.clone()]
                    .iter()
                    .copied()
                    .fold(f32::INFINITY, least_of);
                let high = greatest[around].iter().copied().fold(0.0, greatest_of);
                [low, high]
            }));
        }
        Self { columns, blocks }
    }

    /// Bounds of the depth around a pixel of the map; `None` outside.
    #[inline]
    pub(super) fn at(&self, pixel: [f64; 2]) -> Option<[f32; 2]> {
        let [column, row] = pixel.map(|p| p as u32 as usize / EDGE);
        if column >= self.columns {
            return None;
        }
        self.blocks.get(row * self.columns + column).copied()
    }
}

/// Unlike `f32::min`, does not handle NaN, and compiles to one vector instruction.
#[inline]
fn least_of(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

#[inline]
fn greatest_of(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn bounds_hold_every_depth_within_reach_of_a_pixel() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        let (width, height) = (45u32, 29u32);
        let depths = (0..width * height).map(|i| match i % 7 {
            0 => f32::INFINITY,
            // A corner without depths.
            _ if i % width > 30 && i / width > 12 => f32::INFINITY,
            _ => rng.random_range(5.0..9.0),
        });
        let map = DepthMap::from_vec(width, height, depths.collect()).unwrap();
        for reach in [0usize, 1, 2, 11] {
            let bounds = DepthBounds::new(&map, reach);
            for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
                let block = [x, y].map(|p| p as usize / EDGE * EDGE);
                let inside = |p: u32, from: usize| {
                    (from.saturating_sub(reach)..from + EDGE + reach).contains(&(p as usize))
                };
                let (mut least, mut greatest) = (f32::INFINITY, 0.0);
                for (u, v) in (0..width).flat_map(|u| (0..height).map(move |v| (u, v))) {
                    let depth = *map.get(u, v).unwrap();
                    if inside(u, block[0]) && inside(v, block[1]) && depth.is_finite() {
                        least = f32::min(least, depth);
                        greatest = f32::max(greatest, depth);
                    }
                }
                let pixel = [f64::from(x) + 0.7, f64::from(y) + 0.2];
                assert_eq!(bounds.at(pixel), Some([least, greatest]), "{reach}: {x} {y}");
            }
            for outside in [[48.0, 3.0], [3.0, 32.0]] {
                assert_eq!(bounds.at(outside), None);
            }
        }
    }
}
