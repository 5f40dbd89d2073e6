//! Repeatable noise: a function of a place and a seed, never of the order of calls.

use pulp::{Arch, Simd, WithSimd};
use rand::RngExt;
use stonewise_core::statistics::normal_pair;

/// Gradient noise in the plane (Perlin 1985), sums of octaves of it, and random numbers by key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Noise {
    seed: u64,
}

impl Noise {
    /// Noise of its own for a seed and a purpose.
    pub fn new(seed: u64, purpose: u64) -> Self {
        Self {
            seed: mix(seed ^ mix(purpose.wrapping_add(0x9e37_79b9_7f4a_7c15))),
        }
    }

    /// A number in 0..1 that belongs to the key.
    pub fn uniform(&self, key: u64) -> f64 {
        (mix(self.seed ^ mix(key)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Gradient noise at (x, y): about -1..1, mean zero, wavelength about 1, standard deviation about 0.3.
    pub fn at(&self, x: f64, y: f64) -> f64 {
        let (i, j) = (floor(x), floor(y));
        let (fx, fy) = (x - i as f64, y - j as f64);
        let corner = |di: usize, dj: usize| {
            let [gx, gy] = self.gradient(i + di as i64, j + dj as i64);
            gx * (fx - di as f64) + gy * (fy - dj as f64)
        };
        let (sx, sy) = (fade(fx), fade(fy));
        let low = lerp(corner(0, 0), corner(1, 0), sx);
        let high = lerp(corner(0, 1), corner(1, 1), sx);
        1.3 * lerp(low, high, sy)
    }

    /// The gradient at a lattice point.
    #[inline]
    fn gradient(&self, i: i64, j: i64) -> [f64; 2] {
        let column = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ self.seed;
        let mut h = column ^ (j as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
        h ^= h >> 29;
        h = h.wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h ^= h >> 32;
        // Gradients uniform in a square: cheap, and even enough once octaves are summed.
        [h & 0xffff, (h >> 16) & 0xffff].map(|g| g as f64 / 32768.0 - 1.0)
    }

    /// Sum of `octaves` of noise, each with double the frequency and `gain` times the amplitude of the last.
    pub fn octaves(&self, x: f64, y: f64, octaves: u32, gain: f64) -> f64 {
        let (mut sum, mut amplitude, mut frequency) = (0.0, 1.0, 1.0);
        for k in 0..octaves {
            let shift = f64::from(k) * OCTAVE_SHIFT;
            sum += amplitude * self.at(x * frequency + shift, y * frequency - shift);
            amplitude *= gain;
            frequency *= 2.0;
        }
        sum
    }

    /// Adds `octaves` of noise, times their amplitude, at the places of a row: [`Noise::octaves`] for many
    /// places, at a fraction of the cost, as places in one cell of the lattice share its gradients.
    pub fn add_octaves(&self, row: Row, octaves: Octaves, out: &mut [f64]) {
        Arch::new().dispatch(Sum {
            noise: self,
            row,
            octaves,
            out,
        });
    }

    /// Adds noise times an amplitude at the places of a row.
    #[inline(always)]
    fn add_row(&self, row: Row, amplitude: f64, out: &mut [f64]) {
        let j = floor(row.y);
        let fy = row.y - j as f64;
        let (sy, scale) = (fade(fy), 1.3 * amplitude);

        // At a height in a cell, what its left or right side adds is linear in the distance along x: height
        // and slope.
        let side = |i: i64| {
            let ([gx0, gy0], [gx1, gy1]) = (self.gradient(i, j), self.gradient(i, j + 1));
            [
                scale * lerp(gy0 * fy, gy1 * (fy - 1.0), sy),
                scale * lerp(gx0, gx1, sy),
            ]
        };

        let mut cell = floor(row.x);
        let mut left = side(cell);
        let mut first = 0;

        while first < out.len() {
            let right = side(cell + 1);
            let start = row.x - cell as f64;
            let end = ((1.0 - start) / row.step).ceil().max(0.0) as usize;
            let end = end.clamp(first, out.len());
            for (i, v) in out[first..end].iter_mut().enumerate() {
                let fx = start + (first + i) as f64 * row.step;
                let low = left[0] + left[1] * fx;
                let high = right[0] + right[1] * (fx - 1.0);
                *v += lerp(low, high, fade(fx));
            }
            (first, left) = (end, right);
            cell += 1;
        }
    }
}

/// Octaves are shifted by this against each other, so that their lattice points do not coincide.
const OCTAVE_SHIFT: f64 = 17.37;

/// Largest whole number that is not above; without the call that `f64::floor` is on old processors.
fn floor(v: f64) -> i64 {
    let whole = v as i64;
    whole - i64::from(whole as f64 > v)
}

/// Places side by side: (x + i step, y) for i = 0, 1, ...
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// The first place along x.
    pub x: f64,
    /// The y of all places.
    pub y: f64,
    /// Distance of the places, positive.
    pub step: f64,
}

impl Row {
    /// The row as seen after a move by (x, y) and then in units of `unit`.
    pub fn moved(&self, x: f64, y: f64, unit: f64) -> Self {
        Self {
            x: (self.x + x) / unit,
            y: (self.y + y) / unit,
            step: self.step / unit,
        }
    }

    /// The place `i` along x.
    #[inline]
    pub fn at(&self, i: usize) -> f64 {
        self.x + i as f64 * self.step
    }
}

/// Octaves of noise added along a row. The loops are compiled for the widest vectors of the processor.
struct Sum<'a> {
    noise: &'a Noise,
    row: Row,
    octaves: Octaves,
    out: &'a mut [f64],
}

impl WithSimd for Sum<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (mut amplitude, mut frequency) = (self.octaves.amplitude, 1.0);
        for k in 0..self.octaves.count {
            let shift = f64::from(k) * OCTAVE_SHIFT;
            let octave = Row {
                x: self.row.x * frequency + shift,
                y: self.row.y * frequency - shift,
                step: self.row.step * frequency,
            };
            self.noise.add_row(octave, amplitude, self.out);
            amplitude *= self.octaves.gain;
            frequency *= 2.0;
        }
    }
}

/// A sum of octaves, each with double the frequency and `gain` times the amplitude of the last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Octaves {
    /// How many.
    pub count: u32,
    /// Amplitude of an octave over that of the one before.
    pub gain: f64,
    /// Amplitude of the first.
    pub amplitude: f64,
}

/// A standard normal number.
pub fn normal(rng: &mut impl RngExt) -> f64 {
    normals(rng)[0]
}

/// Two standard normal numbers, independent of each other.
pub fn normals(rng: &mut impl RngExt) -> [f64; 2] {
    normal_pair([rng.random(), rng.random()])
}

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

fn fade(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_centred_continuous_and_depends_on_the_seed() {
        let noise = Noise::new(3, 1);
        let samples: Vec<f64> = (0..20_000)
            .map(|i| noise.at(f64::from(i % 141) * 0.37, f64::from(i / 141) * 0.41))
            .collect();
        let mean = samples.iter().sum::<f64>() / samples.len() as f64;
        let sd = (samples.iter().map(|s| s * s).sum::<f64>() / samples.len() as f64).sqrt();
        assert!(mean.abs() < 0.02, "{mean}");
        assert!((0.2..0.45).contains(&sd), "{sd}");
        assert!((noise.at(2.0 - 1e-9, 0.3) - noise.at(2.0 + 1e-9, 0.3)).abs() < 1e-7);
        assert_ne!(noise.at(0.3, 0.3), Noise::new(4, 1).at(0.3, 0.3));
    }

    #[test]
    fn a_row_is_the_noise_of_its_places() {
        let noise = Noise::new(5, 2);
        for (x, y, step) in [(-3.7, 0.4, 0.013), (2.0, -7.0, 0.25), (0.1, 3.9, 1.7)] {
            let row = Row { x, y, step };
            let octaves = Octaves {
                count: 5,
                gain: 0.55,
                amplitude: 0.4,
            };
            let mut sums = vec![1.0; 300];
            noise.add_octaves(row, octaves, &mut sums);
            for (i, sum) in sums.iter().enumerate() {
                let alone = 1.0 + 0.4 * noise.octaves(row.at(i), y, 5, 0.55);
                assert!((sum - alone).abs() < 1e-9, "{i}: {sum} {alone}");
            }
        }
    }
}
