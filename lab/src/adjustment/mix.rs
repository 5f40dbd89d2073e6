//! Epochs of a scanner made noisier and sparser, as another sensor would have them.

use crate::survey::Places;
use crate::words::Words;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use stonewise_simulate::normal;

/// Noise that is added out of the wall, share of the points that stay, and to which epochs it is done.
#[derive(Clone, Copy, Debug)]
pub struct Mix {
    noise_m: f64,
    share: f64,
    epochs: [bool; 2],
}

impl Mix {
    /// All, or those of the noise and the share that words name.
    pub fn chosen(words: &Words) -> Vec<Self> {
        let numbers = |prefix: &str, all: &str| -> Vec<f64> {
            let list = words.list(prefix, all);
            list.iter().filter_map(|n| n.parse().ok()).collect()
        };
        let noises = numbers("noise=", "1,3,6,11,20");
        let shares = numbers("share=", "100,28,10");
        let mut all = Vec::new();
        for &noise in &noises {
            for &share in &shares {
                for epochs in [[true, false], [false, true], [true, true]] {
                    all.push(Self {
                        noise_m: 1e-3 * noise,
                        share: 0.01 * share,
                        epochs,
                    });
                }
            }
        }
        all
    }

    pub fn name(&self) -> String {
        let of = match self.epochs {
            [true, true] => "both",
            [true, false] => "first",
            _ => "second",
        };
        format!("{:.0} mm, {:.0} %, {of}", 1e3 * self.noise_m, 100.0 * self.share)
    }

    /// Noise that is added to an epoch, metres.
    pub fn noise_m(&self, epoch: usize) -> f64 {
        if self.epochs[epoch] { self.noise_m } else { 0.0 }
    }

    /// Share of an epoch's points that stay.
    pub fn share(&self, epoch: usize) -> f64 {
        if self.epochs[epoch] { self.share } else { 1.0 }
    }

    /// Does it to the points of an epoch.
    pub fn apply(&self, epoch: usize, seed: u64, places: &mut Places) {
        let mut rng = ChaCha8Rng::seed_from_u64(2 * seed + epoch as u64);
        let (noise_m, share) = (self.noise_m(epoch), self.share(epoch));
        for points in places.values_mut() {
            points.retain(|_| rng.random_range(0.0..1.0) < share);
            points.iter_mut().for_each(|p| p.x += noise_m * normal(&mut rng));
        }
        places.retain(|_, points| !points.is_empty());
    }
}
