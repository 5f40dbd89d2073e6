//! Depthwise convolution between two ReLU6, on slices: batch, channel, row, column.

use super::convolution::take_every;
use super::same_padding::same_padding;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

/// Pixels of a row that are computed at once.
const LANES: usize = 16;
/// Padded values that are held at once, unless a row needs more: half of a usual second-level cache.
const HELD: usize = 1 << 15;

/// Sizes of a depthwise convolution with padding `SAME`; the kernel has an odd size.
#[derive(Clone, Copy, Debug)]
pub struct Depthwise {
    pub channels: usize,
    pub rows: usize,
    pub columns: usize,
    pub size: usize,
    pub stride: usize,
}

impl Depthwise {
    pub fn output_size(&self) -> [usize; 2] {
        [self.rows, self.columns].map(|side| side.div_ceil(self.stride))
    }

    /// Length of one part of a padded row, which is stored as `stride` parts: part p holds columns p, p + stride,
    /// p + 2 stride, ...
    fn part(&self) -> usize {
        self.output_size()[1].next_multiple_of(LANES) + (self.size - 1) / self.stride
    }

    /// Number of output rows whose padded input rows are held at once.
    fn rows_at_once(&self) -> usize {
        let rows = HELD / (self.stride * self.part());
        rows.saturating_sub(self.size) / self.stride + 1
    }

    /// Writes ReLU6 of the input rows that the output rows in `range` need to `held`, padded with zeros.
    #[inline(always)]
    fn hold(&self, x: &[f32], range: &Range<usize>, held: &mut [f32]) {
        let [above, before] =
            [self.rows, self.columns].map(|side| same_padding(side, self.size, self.stride));
        for (place, padded) in held.chunks_mut(self.stride * self.part()).enumerate() {
            let row = (range.start * self.stride + place).checked_sub(above);
            let Some(row) = row.filter(|row| *row < self.rows) else {
                padded.fill(0.0);
                continue;
            };
            let x = &x[row * self.columns..][..self.columns];
            for (phase, part) in padded.chunks_mut(self.part()).enumerate() {
                let first = (phase + before * (self.stride - 1)) % self.stride;
                let count = self.columns.saturating_sub(first).div_ceil(self.stride);
                if count > 0 {
                    let part = &mut part[(first + before) / self.stride..][..count];
                    take_every(self.stride, &x[first..], part);
                    part.iter_mut().for_each(|value| *value = value.clamp(0.0, 6.0));
                }
            }
        }
    }

    /// Offset of each weight's input in the padded rows from the first input of an output row.
    fn offsets(&self) -> Vec<usize> {
        let offset = |tap: usize| {
            let [row, column] = [tap / self.size, tap % self.size];
            (row * self.stride + column % self.stride) * self.part() + column / self.stride
        };
        (0..self.size * self.size).map(offset).collect()
    }
}

/// ReLU6 of the convolution of ReLU6 of `x` with weights [channels, 1, size, size], plus a bias for each channel.
pub fn forward(x: &[f32], weight: &[f32], bias: &[f32], shape: &Depthwise) -> Vec<f32> {
    let [rows, columns] = shape.output_size();
    let (taps, padded_row) = (shape.size * shape.size, shape.stride * shape.part());
    let plane = (shape.rows * shape.columns).max(1);
    let mut y = vec![0.0f32; x.len() / plane * rows * columns];
    let offsets = shape.offsets();
    let rows_at_once = shape.rows_at_once().min(rows.max(1));
    let held_rows = |rows: usize| (rows - 1) * shape.stride + shape.size;
    let arch = Arch::new();

    let planes = y.par_chunks_mut((rows * columns).max(1)).zip(x.par_chunks(plane));
    planes.enumerate().for_each_init(
        || vec![0.0f32; held_rows(rows_at_once) * padded_row],
        |held, (place, (y, x))| {
            let channel = place % shape.channels;
            let weight = &weight[channel * taps..][..taps];
            for (strip, y) in y.chunks_mut(rows_at_once * columns).enumerate() {
                let first = strip * rows_at_once;
                let range = first..first + y.len() / columns;
                let held = &mut held[..held_rows(range.len()) * padded_row];
                arch.dispatch(Strip {
                    shape,
                    x,
                    range,
                    held,
                    offsets: &offsets,
                    weight,
                    bias: bias[channel],
                    y,
                });
            }
        },
    );
    y
}

/// Some output rows of a channel. The loops are compiled for the widest vectors of the processor.
struct Strip<'a> {
    shape: &'a Depthwise,
    /// The channel's input.
    x: &'a [f32],
    /// Which output rows.
    range: Range<usize>,
    /// Memory for the padded input rows that they need.
    held: &'a mut [f32],
    /// Of each weight's input, see [`Depthwise::offsets`].
    offsets: &'a [usize],
    weight: &'a [f32],
    bias: f32,
    y: &'a mut [f32],
}

impl WithSimd for Strip<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.shape.hold(self.x, &self.range, self.held);
        let below = self.shape.stride * self.shape.stride * self.shape.part();
        let columns = self.shape.output_size()[1];
        for (row, y) in self.y.chunks_mut(columns).enumerate() {
            add_products(&self.held[row * below..], self.offsets, self.weight, self.bias, y);
        }
    }
}

/// One output row.
#[inline(always)]
fn add_products(seen: &[f32], offsets: &[usize], weight: &[f32], bias: f32, y: &mut [f32]) {
    for (block, y) in y.chunks_mut(LANES).enumerate() {
        let mut sums = [bias; LANES];
        for (offset, weight) in offsets.iter().zip(weight) {
            let seen = &seen[offset + block * LANES..][..LANES];
            sums.iter_mut()
                .zip(seen)
                .for_each(|(sum, seen)| *sum += weight * seen);
        }
        let sums = sums.map(|sum| sum.clamp(0.0, 6.0));
        y.copy_from_slice(&sums[..y.len()]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_definition() {
        let sides = [[8, 12], [7, 33], [1, 1], [2, 5], [16, 2100], [40, 31]];
        for (case, [rows, columns]) in sides.into_iter().enumerate() {
            for [size, stride] in [[3, 1], [3, 2], [5, 1], [5, 2]] {
                let channels = 3;
                let wave = |count: usize, pace: f32| -> Vec<f32> {
                    (0..count).map(|i| (i as f32 * pace).sin()).collect()
                };
                let x: Vec<f32> = wave(2 * channels * rows * columns, 0.7)
                    .iter()
                    .map(|v| 9.0 * v + 2.0)
                    .collect();
                let (weight, bias) = (wave(channels * size * size, 1.3), wave(channels, 2.1));
                let shape = Depthwise {
                    channels,
                    rows,
                    columns,
                    size,
                    stride,
                };
                let y = forward(&x, &weight, &bias, &shape);
                let size_out = [rows.div_ceil(stride), columns.div_ceil(stride)];
                assert_eq!(y.len(), 2 * channels * size_out[0] * size_out[1]);
                // As lab/detector/lite.py pads: half of the zeros needed, rounded down, come first.
                let zeros =
                    |side: usize| ((side.div_ceil(stride) - 1) * stride + size).saturating_sub(side) / 2;
                for (place, y) in y.into_iter().enumerate() {
                    let [column, row] = [place % size_out[1], place / size_out[1] % size_out[0]];
                    let plane = place / size_out[1] / size_out[0];
                    let mut sum = f64::from(bias[plane % channels]);
                    for (down, right) in (0..size * size).map(|tap| (tap / size, tap % size)) {
                        let at = [row * stride + down, column * stride + right];
                        let [Some(at_row), Some(at_column)] =
                            [at[0].checked_sub(zeros(rows)), at[1].checked_sub(zeros(columns))]
                        else {
                            continue;
                        };
                        if at_row < rows && at_column < columns {
                            let seen = x[(plane * rows + at_row) * columns + at_column].clamp(0.0, 6.0);
                            let weight = weight[(plane % channels * size + down) * size + right];
                            sum += f64::from(seen) * f64::from(weight);
                        }
                    }
                    let expected = sum.clamp(0.0, 6.0) as f32;
                    assert!(
                        (y - expected).abs() < 1e-4,
                        "case {case}, {size}, {stride}: {y} {expected}"
                    );
                }
            }
        }
    }
}
