//! Seeds from seeds.

use stonewise_core::statistics::split_mix;

/// A seed that depends on every bit of both numbers.
pub fn mix(seed: u64, number: u64) -> u64 {
    split_mix(seed.wrapping_add(number.wrapping_mul(0xd1b5_4a32_d192_ed03)))
}
