//! Convolution as products of matrices, on slices: batch, channel, row, column.

use super::same_padding::same_padding;
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;
use std::ops::Range;

/// Values of a block of patches: half of a usual second-level cache.
const BLOCK: usize = 1 << 17;
/// Minimum number of columns of a block, if the result has that many: products with fewer are slow.
const LEAST_COLUMNS: usize = 96;

/// Sizes of a convolution; the kernel has an odd size.
#[derive(Clone, Copy, Debug)]
pub struct Geometry {
    pub batch: usize,
    pub inputs: usize,
    pub rows: usize,
    pub columns: usize,
    pub outputs: usize,
    pub size: usize,
    pub stride: usize,
    /// Whether the padding is TensorFlow's `SAME`; otherwise half the kernel's size on all sides.
    pub is_same: bool,
}

impl Geometry {
    #[cfg(test)]
    pub fn input_shape(&self) -> [usize; 4] {
        [self.batch, self.inputs, self.rows, self.columns]
    }

    #[cfg(test)]
    pub fn weight_shape(&self) -> [usize; 4] {
        [self.outputs, self.inputs, self.size, self.size]
    }

    pub fn output_shape(&self) -> [usize; 4] {
        let [rows, columns] = self.output_size();
        [self.batch, self.outputs, rows, columns]
    }

    fn output_size(&self) -> [usize; 2] {
        [self.rows, self.columns].map(|side| side.div_ceil(self.stride))
    }

    /// Pixels of an output channel.
    fn output_pixels(&self) -> usize {
        let [rows, columns] = self.output_size();
        rows * columns
    }

    /// Weights of one input for one output.
    fn taps(&self) -> usize {
        self.size * self.size
    }

    /// An output pixel sees the input pixel at the same place and no other.
    fn is_pointwise(&self) -> bool {
        self.size == 1 && self.stride == 1
    }

    /// Output places along an axis of `outputs` at which tap `tap` lies inside an input of `inputs`, and the
    /// input place of the first.
    fn inside(&self, tap: usize, outputs: usize, inputs: usize) -> (Range<usize>, usize) {
        let padding = if self.is_same {
            same_padding(inputs, self.size, self.stride)
        } else {
            self.size / 2
        };
        let first = padding.saturating_sub(tap).div_ceil(self.stride);
        let end = (inputs + padding)
            .saturating_sub(tap)
            .div_ceil(self.stride)
            .min(outputs);
        (
            first.min(end)..end,
            (first * self.stride + tap).saturating_sub(padding),
        )
    }
}

/// The convolution of a batch.
///
/// Patches of a few output rows at a time become the columns of a matrix that the weights are multiplied
/// with.
pub fn forward(x: &[f32], weight: &[f32], bias: Option<&[f32]>, geometry: &Geometry) -> Vec<f32> {
    let pixels = geometry.output_pixels();
    let [rows, columns] = geometry.output_size();
    let depth = geometry.inputs * geometry.taps();
    let weight = MatRef::from_row_major_slice(weight, geometry.outputs, depth);
    let mut y = vec![0.0f32; geometry.batch * geometry.outputs * pixels];

    if let Some(bias) = bias {
        let planes = y.par_chunks_mut(pixels.max(1)).enumerate();
        planes.for_each(|(plane, values)| values.fill(bias[plane % geometry.outputs]));
    }

    let least = LEAST_COLUMNS.div_ceil(columns.max(1));
    let rows_at_once = (BLOCK / (depth * columns).max(1)).clamp(least.min(rows.max(1)), rows.max(1));
    let image_size = geometry.inputs * geometry.rows * geometry.columns;
    let mut blocks = Vec::new();

    for (image, y) in y.chunks_mut((geometry.outputs * pixels).max(1)).enumerate() {
        let x = &x[image * image_size..][..image_size];
        let mut rest = MatMut::from_row_major_slice_mut(y, geometry.outputs, pixels);
        for first in (0..rows).step_by(rows_at_once) {
            let range = first..(first + rows_at_once).min(rows);
            let (block, after) = rest.split_at_col_mut(range.len() * columns);
            blocks.push((x, range, block));
            rest = after;
        }
    }

    blocks
        .into_par_iter()
        .for_each_init(Vec::new, |patches, (x, range, block)| {
            let count = range.len() * columns;
            let seen = if geometry.is_pointwise() {
                let first = range.start * columns;
                MatRef::from_row_major_slice(x, depth, pixels).subcols(first, count)
            } else {
                gather(x, geometry, range, patches);
                MatRef::from_row_major_slice(patches.as_slice(), depth, count)
            };
            matmul(block, Accum::Add, weight, seen, 1.0, Par::Seq);
        });
    y
}

/// Derivatives with regard to image and weight, each where `wanted`, from that with regard to the result.
///
/// Each thread takes some of the inputs, whose patches no other thread needs.
pub fn backward(
    x: &[f32],
    weight: &[f32],
    grad: &[f32],
    geometry: &Geometry,
    [wants_x, wants_weight]: [bool; 2],
) -> [Vec<f32>; 2] {
    let plane = geometry.rows * geometry.columns;
    let depth = geometry.inputs * geometry.taps();
    let zeros = |wanted: bool, count: usize| vec![0.0f32; if wanted { count } else { 0 }];
    let mut x_grad = zeros(wants_x, geometry.batch * geometry.inputs * plane);
    let mut weight_grad = zeros(wants_weight, geometry.outputs * depth);
    let weight_matrix =
        wants_weight.then(|| MatMut::from_row_major_slice_mut(&mut weight_grad, geometry.outputs, depth));
    let layer = Layer {
        x,
        weight: MatRef::from_row_major_slice(weight, geometry.outputs, depth),
        grad,
        geometry,
    };
    shares(&mut x_grad, weight_matrix, geometry)
        .into_par_iter()
        .for_each_init(
            || (Vec::new(), Vec::new()),
            |(patches, spread), mut share| {
                for image in 0..geometry.batch {
                    layer.add_weight_grad(image, &mut share, patches);
                    layer.set_x_grad(image, &mut share, spread);
                }
            },
        );

    [x_grad, weight_grad]
}

/// Some of the inputs with their parts of the derivatives.
struct Share<'a> {
    /// The first of the inputs, and how many.
    start: usize,
    inputs: usize,
    /// Derivative with regard to the inputs, image by image; empty where it is not needed.
    x: Vec<&'a mut [f32]>,
    /// Derivative with regard to their weights.
    weight: Option<MatMut<'a, f32>>,
}

/// Divides the derivatives by inputs.
fn shares<'a>(
    x_grad: &'a mut [f32],
    weight_grad: Option<MatMut<'a, f32>>,
    geometry: &Geometry,
) -> Vec<Share<'a>> {
    let plane = geometry.rows * geometry.columns;
    let at_once = (8 * BLOCK / (geometry.taps() * geometry.output_pixels()).max(1))
        .min(geometry.inputs.div_ceil(8))
        .max(1);
    let mut rest = weight_grad;
    let mut shares: Vec<Share> = Vec::new();

    for start in (0..geometry.inputs).step_by(at_once) {
        let inputs = at_once.min(geometry.inputs - start);
        let (weight, after) = rest
            .map(|rest| rest.split_at_col_mut(inputs * geometry.taps()))
            .unzip();
        rest = after;
        shares.push(Share {
            start,
            inputs,
            x: Vec::new(),
            weight,
        });
    }

    for image in x_grad.chunks_mut((geometry.inputs * plane).max(1)) {
        let parts = image.chunks_mut((at_once * plane).max(1));
        parts
            .zip(&mut shares)
            .for_each(|(part, share)| share.x.push(part));
    }

    shares
}

/// What the derivatives of a convolution are computed from.
struct Layer<'a> {
    x: &'a [f32],
    weight: MatRef<'a, f32>,
    grad: &'a [f32],
    geometry: &'a Geometry,
}

impl Layer<'_> {
    /// Derivative with regard to the result of one image: output channel x pixel.
    fn image_grad(&self, image: usize) -> MatRef<'_, f32> {
        let (outputs, pixels) = (self.geometry.outputs, self.geometry.output_pixels());
        let grad = &self.grad[image * outputs * pixels..][..outputs * pixels];
        MatRef::from_row_major_slice(grad, outputs, pixels)
    }

    fn add_weight_grad(&self, image: usize, share: &mut Share, patches: &mut Vec<f32>) {
        let Some(weight_grad) = &mut share.weight else {
            return;
        };
        let (geometry, inputs) = (self.geometry, share.inputs);
        let (plane, pixels) = (geometry.rows * geometry.columns, geometry.output_pixels());
        let x = &self.x[(image * geometry.inputs + share.start) * plane..][..inputs * plane];
        let seen = if geometry.is_pointwise() {
            MatRef::from_row_major_slice(x, inputs, pixels)
        } else {
            gather(x, geometry, 0..geometry.output_size()[0], patches);
            MatRef::from_row_major_slice(patches.as_slice(), inputs * geometry.taps(), pixels)
        };
        let grad = self.image_grad(image);
        matmul(
            weight_grad.as_mut(),
            Accum::Add,
            grad,
            seen.transpose(),
            1.0,
            Par::Seq,
        );
    }

    fn set_x_grad(&self, image: usize, share: &mut Share, spread: &mut Vec<f32>) {
        let Some(x_grad) = share.x.get_mut(image) else {
            return;
        };
        let (geometry, pixels) = (self.geometry, self.geometry.output_pixels());
        let depth = share.inputs * geometry.taps();
        let weight = self
            .weight
            .subcols(share.start * geometry.taps(), depth)
            .transpose();
        let grad = self.image_grad(image);
        if geometry.is_pointwise() {
            let target = MatMut::from_row_major_slice_mut(x_grad, share.inputs, pixels);
            matmul(target, Accum::Replace, weight, grad, 1.0, Par::Seq);
        } else {
            spread.resize(depth * pixels, 0.0);
            let target = MatMut::from_row_major_slice_mut(spread.as_mut_slice(), depth, pixels);
            matmul(target, Accum::Replace, weight, grad, 1.0, Par::Seq);
            scatter(spread, geometry, x_grad);
        }
    }
}

/// Sum of every output channel over images and pixels.
pub fn channel_sums(grad: &[f32], geometry: &Geometry) -> Vec<f32> {
    let pixels = geometry.output_pixels();
    let mut sums = vec![0.0f32; geometry.outputs];
    for image in grad.chunks((geometry.outputs * pixels).max(1)) {
        for (sum, plane) in sums.iter_mut().zip(image.chunks(pixels)) {
            *sum += plane.iter().sum::<f32>();
        }
    }
    sums
}

/// Patches around the pixels of some output rows: [input, tap row, tap column] x [row, column].
fn gather(x: &[f32], geometry: &Geometry, range: Range<usize>, patches: &mut Vec<f32>) {
    let [out_rows, out_columns] = geometry.output_size();
    let inputs = x.len() / (geometry.rows * geometry.columns).max(1);
    patches.clear();
    patches.resize(inputs * geometry.taps() * range.len() * out_columns, 0.0);
    let mut lines = patches.chunks_mut((range.len() * out_columns).max(1));
    for plane in x.chunks((geometry.rows * geometry.columns).max(1)) {
        for tap_row in 0..geometry.size {
            let (rows, first_row) = geometry.inside(tap_row, out_rows, geometry.rows);
            for tap_column in 0..geometry.size {
                let Some(line) = lines.next() else {
                    return;
                };
                let (columns, first) = geometry.inside(tap_column, out_columns, geometry.columns);
                let wanted = rows.start.max(range.start)..rows.end.min(range.end);
                for row in wanted {
                    let from = (first_row + (row - rows.start) * geometry.stride) * geometry.columns + first;
                    let to = (row - range.start) * out_columns;
                    let target = &mut line[to + columns.start..to + columns.end];
                    take_every(geometry.stride, &plane[from..], target);
                }
            }
        }
    }
}

/// Fills a row with every `stride`-th value of another.
#[inline(always)]
pub fn take_every(stride: usize, source: &[f32], target: &mut [f32]) {
    match stride {
        1 => target.copy_from_slice(&source[..target.len()]),
        2 => {
            let (pairs, last) = source.as_chunks::<2>();
            let (whole, rest) = target.split_at_mut(target.len().min(pairs.len()));
            whole.iter_mut().zip(pairs).for_each(|(to, pair)| *to = pair[0]);
            rest.iter_mut().zip(last).for_each(|(to, from)| *to = *from);
        }
        _ => {
            let source = source.iter().step_by(stride);
            target.iter_mut().zip(source).for_each(|(to, from)| *to = *from);
        }
    }
}

/// Adds patches around all output pixels back to where they came from.
fn scatter(patches: &[f32], geometry: &Geometry, x: &mut [f32]) {
    let [out_rows, out_columns] = geometry.output_size();
    let mut lines = patches.chunks((out_rows * out_columns).max(1));
    for plane in x.chunks_mut((geometry.rows * geometry.columns).max(1)) {
        for tap_row in 0..geometry.size {
            let (rows, first_row) = geometry.inside(tap_row, out_rows, geometry.rows);
            for tap_column in 0..geometry.size {
                let Some(line) = lines.next() else {
                    return;
                };
                let (columns, first) = geometry.inside(tap_column, out_columns, geometry.columns);
                for row in rows.clone() {
                    let to = (first_row + (row - rows.start) * geometry.stride) * geometry.columns + first;
                    let source = &line[row * out_columns..][columns.clone()];
                    if geometry.stride == 1 {
                        let target = &mut plane[to..to + columns.len()];
                        target
                            .iter_mut()
                            .zip(source)
                            .for_each(|(target, source)| *target += source);
                    } else {
                        let target = plane[to..].iter_mut().step_by(geometry.stride);
                        target.zip(source).for_each(|(target, source)| *target += source);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CASES: [Geometry; 10] = {
        let base = Geometry {
            batch: 2,
            inputs: 3,
            rows: 7,
            columns: 10,
            outputs: 4,
            size: 3,
            stride: 1,
            is_same: false,
        };
        let same = Geometry {
            stride: 2,
            is_same: true,
            ..base
        };
        [
            base,
            same,
            Geometry { size: 5, ..same },
            Geometry { columns: 300, ..same },
            Geometry { stride: 2, ..base },
            Geometry { size: 1, ..base },
            Geometry {
                size: 1,
                stride: 2,
                ..base
            },
            Geometry {
                size: 7,
                stride: 2,
                rows: 2,
                ..base
            },
            // So large that the rows of a result are computed in several blocks, and the inputs in shares of two.
            Geometry {
                inputs: 10,
                columns: 300,
                ..base
            },
            Geometry {
                inputs: 64,
                columns: 700,
                size: 1,
                ..base
            },
        ]
    };

    fn wave(count: usize, pace: f32) -> Vec<f32> {
        (0..count).map(|i| (i as f32 * pace).sin()).collect()
    }

    /// Calls `each` with the places of output, input and weight of every product of the definition.
    fn for_each_product(g: &Geometry, mut each: impl FnMut(usize, usize, usize)) {
        let [rows, columns] = g.output_size();
        let before = |side: usize| {
            // As lab/detector/lite.py pads: half of the zeros needed, rounded down, come first.
            let needed = ((side.div_ceil(g.stride) - 1) * g.stride + g.size).saturating_sub(side);
            if g.is_same { needed / 2 } else { g.size / 2 }
        };
        let [above, left] = [g.rows, g.columns].map(before);
        for image in 0..g.batch {
            for output in 0..g.outputs {
                for (row, column) in (0..rows * columns).map(|i| (i / columns, i % columns)) {
                    for input in 0..g.inputs {
                        for (tap_row, tap_column) in (0..g.taps()).map(|i| (i / g.size, i % g.size)) {
                            let (y, x) = (row * g.stride + tap_row, column * g.stride + tap_column);
                            if y < above || x < left || y - above >= g.rows || x - left >= g.columns {
                                continue;
                            }
                            each(
                                ((image * g.outputs + output) * rows + row) * columns + column,
                                ((image * g.inputs + input) * g.rows + y - above) * g.columns + x - left,
                                ((output * g.inputs + input) * g.size + tap_row) * g.size + tap_column,
                            );
                        }
                    }
                }
            }
        }
    }

    fn assert_close(a: &[f32], b: &[f32]) {
        assert_eq!(a.len(), b.len());
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() < 1e-4 * b.abs().max(1.0), "{a} {b}");
        }
    }

    #[test]
    fn agrees_with_the_definition_forward_and_backward() {
        for g in CASES {
            let x = wave(g.input_shape().iter().product(), 0.7);
            let weight = wave(g.weight_shape().iter().product(), 1.3);
            let bias = wave(g.outputs, 2.1);
            let grad = wave(g.output_shape().iter().product(), 0.9);
            let mut y: Vec<f32> = (0..grad.len())
                .map(|i| bias[i / g.output_pixels() % g.outputs])
                .collect();
            let mut x_grad = vec![0.0; x.len()];
            let mut weight_grad = vec![0.0; weight.len()];
            for_each_product(&g, |output, input, tap| {
                y[output] += x[input] * weight[tap];
                x_grad[input] += grad[output] * weight[tap];
                weight_grad[tap] += grad[output] * x[input];
            });
            assert_close(&forward(&x, &weight, Some(&bias), &g), &y);
            let [got_x, got_weight] = backward(&x, &weight, &grad, &g, [true, true]);
            assert_close(&got_x, &x_grad);
            assert_close(&got_weight, &weight_grad);
        }
    }
}
