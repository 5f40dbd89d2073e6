//! Part 2 of 3 of the weights of stonewise's built-in stone detector, which `stonewise-segment` puts together.
//!
//! A registry takes packages of 10 MB, and the weights have 25.

/// The bytes.
pub static PART: &[u8] = include_bytes!("../weights.part");
