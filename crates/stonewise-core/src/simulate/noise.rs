//! Repeatable noise: a function of a place and a seed, never of the order in which it is asked.

use rand::RngExt;
use std::f64::consts::TAU;

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
        let columns = [i, i + 1].map(|i| (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ self.seed);
        let rows = [j, j + 1].map(|j| (j as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f));
        let corner = |di: usize, dj: usize| {
            let mut h = columns[di] ^ rows[dj];
            h ^= h >> 29;
            h = h.wrapping_mul(0xbf58_476d_1ce4_e5b9);
            h ^= h >> 32;
            // Gradients uniform in a square: cheap, and even enough once octaves are summed.
            let gx = (h & 0xffff) as f64 / 32768.0 - 1.0;
            let gy = ((h >> 16) & 0xffff) as f64 / 32768.0 - 1.0;
            gx * (fx - di as f64) + gy * (fy - dj as f64)
        };
        let (sx, sy) = (fade(fx), fade(fy));
        let low = lerp(corner(0, 0), corner(1, 0), sx);
        let high = lerp(corner(0, 1), corner(1, 1), sx);
        1.3 * lerp(low, high, sy)
    }

    /// Sum of `octaves` of noise, each with double the frequency and `gain` times the amplitude of the last.
    pub fn octaves(&self, x: f64, y: f64, octaves: u32, gain: f64) -> f64 {
        let (mut sum, mut amplitude, mut frequency) = (0.0, 1.0, 1.0);
        for k in 0..octaves {
            // Shifted octaves, so that their lattice points do not coincide.
            let shift = f64::from(k) * 17.37;
            sum += amplitude * self.at(x * frequency + shift, y * frequency - shift);
            amplitude *= gain;
            frequency *= 2.0;
        }
        sum
    }
}

/// Largest whole number that is not above; without the call that `f64::floor` is on old processors.
fn floor(v: f64) -> i64 {
    let whole = v as i64;
    whole - i64::from(whole as f64 > v)
}

/// A standard normal number (Box and Muller 1958).
pub fn normal(rng: &mut impl RngExt) -> f64 {
    let (u, v): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * (TAU * v).cos()
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
}
