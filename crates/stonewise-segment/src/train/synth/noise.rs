//! Procedural noise from periodic tables: a table is computed once, and a field is a random rotation, stretch
//! and shift of it.
//!
//! A look-up costs a few nanoseconds, where summing octaves at every pixel would cost most of a photo's time.

use super::draw::{Rng, between, log_between};
use std::sync::LazyLock;

/// Side of a table, samples; a power of two.
const SIDE: usize = 512;
/// Lattice cells of the coarsest octave along a side of the fractal table.
const FRACTAL_CELLS: usize = 8;
/// Lattice cells along a side of the smooth and the cellular table.
const SMOOTH_CELLS: usize = 64;

/// What a field looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Grain {
    /// Gradient noise (Perlin 1985) summed over six octaves: mean 0, standard deviation 1.
    Fractal,
    /// One octave of gradient noise: mean 0, standard deviation 1.
    Smooth,
    /// Distance to the nearest of scattered points in units of their spacing (Worley 1996): 0 to about 1.2.
    Cells,
}

static FRACTAL: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let mut sum = vec![0.0; SIDE * SIDE];
    let mut amplitude = 1.0;
    for octave in 0..6 {
        add_gradient_noise(&mut sum, FRACTAL_CELLS << octave, amplitude, octave as u32);
        amplitude *= 0.55;
    }
    standardised(sum)
});

static SMOOTH: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let mut sum = vec![0.0; SIDE * SIDE];
    add_gradient_noise(&mut sum, SMOOTH_CELLS, 1.0, 17);
    standardised(sum)
});

static CELLS: LazyLock<Vec<f32>> = LazyLock::new(cell_distances);

/// Noise over the plane.
#[derive(Clone, Copy)]
pub(super) struct Field {
    table: &'static [f32],
    /// Table coordinates of (x, y): rows of a 2 x 2 matrix, then the shift.
    matrix: [f32; 4],
    shift: [f32; 2],
}

impl Field {
    /// A field whose coarsest features measure `wavelength` along and across a direction, turned by `angle`
    /// radians.
    pub(super) fn new(rng: &mut Rng, grain: Grain, wavelength: [f32; 2], angle: f32) -> Self {
        let (table, cells): (&'static [f32], usize) = match grain {
            Grain::Fractal => (&FRACTAL, FRACTAL_CELLS),
            Grain::Smooth => (&SMOOTH, SMOOTH_CELLS),
            Grain::Cells => (&CELLS, SMOOTH_CELLS),
        };
        let step = (SIDE / cells) as f32;
        let (sin, cos) = angle.sin_cos();
        let (along, across) = (step / wavelength[0], step / wavelength[1]);
        let side = SIDE as f32;
        Self {
            table,
            matrix: [cos * along, sin * along, -sin * across, cos * across],
            shift: [between(rng, 0.0, side), between(rng, 0.0, side)],
        }
    }

    /// A field whose coarsest features measure `wavelength` in all directions, in a random direction of the table.
    pub(super) fn isotropic(rng: &mut Rng, grain: Grain, wavelength: f32) -> Self {
        let angle = between(rng, 0.0, std::f32::consts::TAU);
        Self::new(rng, grain, [wavelength; 2], angle)
    }

    /// An isotropic field of a wavelength drawn from `low` to `high`, uniformly in the logarithm.
    pub(super) fn sized(rng: &mut Rng, grain: Grain, low: f32, high: f32) -> Self {
        let wavelength = log_between(rng, low, high);
        Self::isotropic(rng, grain, wavelength)
    }

    /// The field's value at a place.
    #[inline(always)]
    pub(super) fn at(&self, x: f32, y: f32) -> f32 {
        let u = self.matrix[0] * x + self.matrix[1] * y + self.shift[0];
        let v = self.matrix[2] * x + self.matrix[3] * y + self.shift[1];
        let (i, fu) = floor(u);
        let (j, fv) = floor(v);
        let mask = SIDE - 1;
        let (i0, i1) = (i as usize & mask, i.wrapping_add(1) as usize & mask);
        let (j0, j1) = (
            (j as usize & mask) * SIDE,
            (j.wrapping_add(1) as usize & mask) * SIDE,
        );
        let top = self.table[j0 + i0] + fu * (self.table[j0 + i1] - self.table[j0 + i0]);
        let bottom = self.table[j1 + i0] + fu * (self.table[j1 + i1] - self.table[j1 + i0]);
        top + fv * (bottom - top)
    }
}

#[inline(always)]
fn floor(x: f32) -> (i32, f32) {
    let truncated = x as i32;
    let whole = truncated - i32::from(x < truncated as f32);
    (whole, x - whole as f32)
}

/// Adds periodic gradient noise with `cells` lattice cells along a side.
fn add_gradient_noise(sum: &mut [f32], cells: usize, amplitude: f32, seed: u32) {
    let step = SIDE / cells;
    for (index, value) in sum.iter_mut().enumerate() {
        let (x, y) = (index % SIDE, index / SIDE);
        let (i, j) = (x / step, y / step);
        // Half a sample off the lattice, where gradient noise vanishes.
        let fx = ((x % step) as f32 + 0.5) / step as f32;
        let fy = ((y % step) as f32 + 0.5) / step as f32;
        let corner = |di: usize, dj: usize| {
            let h = hash(((i + di) % cells) as u32, ((j + dj) % cells) as u32, seed);
            let gx = (h & 0xffff) as f32 / 32768.0 - 1.0;
            let gy = (h >> 16) as f32 / 32768.0 - 1.0;
            gx * (fx - di as f32) + gy * (fy - dj as f32)
        };
        let (sx, sy) = (fade(fx), fade(fy));
        let top = corner(0, 0) + sx * (corner(1, 0) - corner(0, 0));
        let bottom = corner(0, 1) + sx * (corner(1, 1) - corner(0, 1));
        *value += amplitude * (top + sy * (bottom - top));
    }
}

fn cell_distances() -> Vec<f32> {
    let step = SIDE / SMOOTH_CELLS;
    (0..SIDE * SIDE)
        .map(|index| {
            let x = (index % SIDE) as f32 / step as f32;
            let y = (index / SIDE) as f32 / step as f32;
            let (i, j) = (x as usize, y as usize);
            let mut nearest = f32::INFINITY;
            for dj in 0..3 {
                for di in 0..3 {
                    let cell = |k: usize, d: usize| (k + SMOOTH_CELLS + d - 1) % SMOOTH_CELLS;
                    let h = hash(cell(i, di) as u32, cell(j, dj) as u32, 99);
                    let px = (i + di) as f32 - 1.0 + (h & 0xffff) as f32 / 65536.0;
                    let py = (j + dj) as f32 - 1.0 + (h >> 16) as f32 / 65536.0;
                    nearest = nearest.min((x - px).hypot(y - py));
                }
            }
            nearest
        })
        .collect()
}

fn standardised(mut table: Vec<f32>) -> Vec<f32> {
    let count = table.len() as f32;
    let mean = table.iter().sum::<f32>() / count;
    let variance = table.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / count;
    for value in &mut table {
        *value = (*value - mean) / variance.sqrt();
    }
    table
}

fn fade(t: f32) -> f32 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

/// A number that belongs to a lattice point.
fn hash(i: u32, j: u32, seed: u32) -> u32 {
    let mut h = i.wrapping_mul(0x9e37_79b1) ^ j.wrapping_mul(0x85eb_ca77) ^ seed.wrapping_mul(0xc2b2_ae3d);
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    h ^ (h >> 15)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn fields_are_centred_continuous_and_as_coarse_as_asked() {
        let mut rng = Rng::seed_from_u64(1);
        for grain in [Grain::Fractal, Grain::Smooth] {
            let field = Field::isotropic(&mut rng, grain, 20.0);
            let values: Vec<f32> = (0..40_000)
                .map(|i| field.at((i % 200) as f32 * 1.7, (i / 200) as f32 * 1.7))
                .collect();
            let mean = values.iter().sum::<f32>() / values.len() as f32;
            let sd = (values.iter().map(|v| v * v).sum::<f32>() / values.len() as f32).sqrt();
            assert!(mean.abs() < 0.35, "{mean}");
            assert!((0.6..1.4).contains(&sd), "{sd}");
            assert!((field.at(3.0, -7.0) - field.at(3.0 + 1e-3, -7.0)).abs() < 0.01);
        }
        // Zero crossings along a line: gradient noise of wavelength 20 has one every 10 to 25.
        let field = Field::isotropic(&mut rng, Grain::Smooth, 20.0);
        let crossings = (0..20_000)
            .filter(|&i| {
                let x = i as f32 * 0.5;
                (field.at(x, 3.0) > 0.0) != (field.at(x + 0.5, 3.0) > 0.0)
            })
            .count();
        assert!((400..1000).contains(&crossings), "{crossings}");
    }
}
