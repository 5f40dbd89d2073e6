//! TensorFlow's padding `SAME`.

/// Zeros before the first of `inputs` values so that a kernel of `size` gives ceil(inputs / stride) values: half of
/// the zeros needed, rounded down; the others come after the last value.
pub fn same_padding(inputs: usize, size: usize, stride: usize) -> usize {
    (inputs.div_ceil(stride) * stride + size).saturating_sub(stride + inputs) / 2
}
