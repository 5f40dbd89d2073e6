//! Normal numbers that repeat on every machine.

use crate::statistics::{normal_pair, split_mix};

/// A sequence of normal numbers, another for each seed.
pub(crate) struct Random {
    counter: u64,
    next: Option<f64>,
}

impl Random {
    pub fn new(seed: u64) -> Self {
        Self {
            counter: split_mix(seed),
            next: None,
        }
    }

    /// Uniform in 0..1.
    pub fn uniform(&mut self) -> f64 {
        self.counter = self.counter.wrapping_add(1);
        (split_mix(self.counter) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        if let Some(kept) = self.next.take() {
            return kept;
        }
        let [value, kept] = normal_pair([self.uniform(), self.uniform()]);
        self.next = Some(kept);
        value
    }
}
