//! Convolution of 3 x 3 weights and stride 1 with a quarter of the multiplications: F(4 x 4, 3 x 3) of
//! Winograd's minimal filtering (Lavin & Gray 2016, section 4), on slices: batch, channel, row, column.
//!
//! Each 4 x 4 pixels of the result are made of 6 x 6 of the image. Both are transformed along columns and
//! rows; between the transforms, each of the 36 places is a product of matrices of its own. The result
//! differs from that of [`convolution`](super::convolution) by rounding, at most 1e-4 of its spread.

use super::convolution::Geometry;
use super::filters::{CELL, Filters, PLACES, SIDE};
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

/// Approximate number of cells computed at once: matrix products of fewer are slow, and the data of more do
/// not fit in the cache.
const CELLS: usize = 128;
/// The number of cells is padded to a multiple of this, the number of values in the widest SIMD register.
const LANES: usize = 16;

/// The convolution of a batch, of stride 1.
pub fn forward(x: &[f32], filters: &Filters, bias: Option<&[f32]>, geometry: &Geometry) -> Vec<f32> {
    let layer = Layer {
        x,
        filters,
        bias,
        geometry,
        grid: [geometry.rows, geometry.columns].map(|side| side.div_ceil(CELL)),
    };
    let mut y = vec![0.0f32; geometry.output_shape().iter().product()];
    let blocks = layer.blocks(&mut y);
    blocks
        .into_par_iter()
        .for_each_init(Buffers::default, |buffers, block| layer.compute(block, buffers));
    y
}

/// Cells that are computed at once: some rows of cells of some images.
struct Block<'a> {
    images: Range<usize>,
    rows: Range<usize>,
    /// Pixels of the result: image, output, row of cells.
    targets: Vec<&'a mut [f32]>,
}

/// Memory that blocks use in turn.
#[derive(Default)]
struct Buffers {
    /// Rows of the image for the six rows of a transformed cell, then the same transformed: row, phase, cell.
    lines: [Vec<f32>; 2],
    /// Transformed image: place, input, cell.
    seen: Vec<f32>,
    /// Transformed result: place, output, cell.
    made: Vec<f32>,
    /// Result of one output, transformed back along columns: place along the row, row in the cell, cell.
    halves: Vec<f32>,
    /// Result of one output: row in the cell, column in the cell, cell.
    pixels: Vec<f32>,
}

struct Layer<'a> {
    x: &'a [f32],
    filters: &'a Filters,
    bias: Option<&'a [f32]>,
    geometry: &'a Geometry,
    /// Rows and columns of cells.
    grid: [usize; 2],
}

impl Layer<'_> {
    /// Places for a row of cells: one more than it has, so that the last cell has a neighbour.
    fn slots(&self) -> usize {
        self.grid[1] + 1
    }

    fn blocks<'y>(&self, y: &'y mut [f32]) -> Vec<Block<'y>> {
        let g = self.geometry;
        let rows = evenly(self.grid[0], CELLS / self.slots());
        let images = evenly(g.batch, CELLS / (self.slots() * self.grid[0]).max(1));
        let mut blocks: Vec<Block> = Vec::new();
        for first_image in (0..g.batch).step_by(images) {
            for first_row in (0..self.grid[0]).step_by(rows) {
                blocks.push(Block {
                    images: first_image..(first_image + images).min(g.batch),
                    rows: first_row..(first_row + rows).min(self.grid[0]),
                    targets: Vec::new(),
                });
            }
        }
        let per_image = self.grid[0].div_ceil(rows);
        for (plane, pixels) in y.chunks_mut((g.rows * g.columns).max(1)).enumerate() {
            let first = plane / g.outputs / images * per_image;
            for (row, pixels) in pixels.chunks_mut(CELL * g.columns).enumerate() {
                blocks[first + row / rows].targets.push(pixels);
            }
        }
        blocks
    }

    fn compute(&self, mut block: Block, buffers: &mut Buffers) {
        let (inputs, outputs) = (self.geometry.inputs, self.geometry.outputs);
        let slots = block.images.len() * block.rows.len() * self.slots();
        let cells = slots.next_multiple_of(LANES);
        for lines in &mut buffers.lines {
            lines.resize(SIDE * CELL * (cells + LANES), 0.0);
        }
        buffers.seen.resize(PLACES * inputs * cells, 0.0);
        buffers.made.resize(PLACES * outputs * cells, 0.0);
        buffers.halves.resize(SIDE * CELL * cells, 0.0);
        buffers.pixels.resize(CELL * CELL * cells, 0.0);

        for input in 0..inputs {
            let [lines, transformed] = &mut buffers.lines;
            self.gather(input, &block, cells + LANES, lines);
            transform_image(lines, transformed, &mut buffers.seen, [input, inputs, cells]);
        }

        for place in 0..PLACES {
            let seen = &buffers.seen[place * inputs * cells..][..inputs * cells];
            let made = &mut buffers.made[place * outputs * cells..][..outputs * cells];
            matmul(
                MatMut::from_row_major_slice_mut(made, outputs, cells),
                Accum::Replace,
                MatRef::from_row_major_slice(self.filters.place(place), outputs, inputs),
                MatRef::from_row_major_slice(seen, inputs, cells),
                1.0,
                Par::Seq,
            );
        }

        for output in 0..outputs {
            let bias = self.bias.map_or(0.0, |bias| bias[output]);
            let (halves, pixels) = (&mut buffers.halves, &mut buffers.pixels);
            transform_result(&buffers.made, [output, outputs, cells], bias, halves, pixels);
            self.scatter(output, &mut block, cells, pixels);
        }
    }

    /// The rows of an input that cells see: row in the cell, column modulo four, cell, of which there are
    /// `length`. Column 0 is that before the image.
    fn gather(&self, input: usize, block: &Block, length: usize, lines: &mut [f32]) {
        let g = self.geometry;
        let slots = self.slots();
        for (row, lines) in lines.chunks_mut(CELL * length).enumerate() {
            lines.fill(0.0);
            let (first, rest) = lines.split_at_mut(length);
            let (second, rest) = rest.split_at_mut(length);
            let (third, fourth) = rest.split_at_mut(length);
            let mut begin = 0;
            for image in block.images.clone() {
                let plane = &self.x[(image * g.inputs + input) * g.rows * g.columns..][..g.rows * g.columns];
                for cell_row in block.rows.clone() {
                    let y = CELL * cell_row + row;
                    if (1..=g.rows).contains(&y) {
                        let line = &plane[(y - 1) * g.columns..][..g.columns];
                        let (fours, rest) = line.as_chunks::<CELL>();
                        let to = begin..begin + fours.len();
                        let targets = second[to.clone()].iter_mut().zip(&mut third[to.clone()]);
                        let others = fourth[to.clone()]
                            .iter_mut()
                            .zip(&mut first[to.start + 1..=to.end]);
                        for ((four, (a, b)), (c, d)) in fours.iter().zip(targets).zip(others) {
                            [*a, *b, *c, *d] = *four;
                        }
                        let phases = [&mut second[to.end], &mut third[to.end], &mut fourth[to.end]];
                        phases
                            .into_iter()
                            .zip(rest)
                            .for_each(|(target, value)| *target = *value);
                    }
                    begin += slots;
                }
            }
        }
    }

    /// Brings the pixels of an output to their rows.
    fn scatter(&self, output: usize, block: &mut Block, cells: usize, pixels: &[f32]) {
        let slots = self.slots();
        let columns = self.geometry.columns;
        let mut begin = 0;
        for image in 0..block.images.len() {
            for row in 0..block.rows.len() {
                let target =
                    &mut block.targets[(image * self.geometry.outputs + output) * block.rows.len() + row];
                for (line, pixels) in target.chunks_mut(columns).zip(pixels.chunks(CELL * cells)) {
                    let phase = |at: usize| &pixels[at * cells + begin..][..slots];
                    let phases = [phase(0), phase(1), phase(2), phase(3)];
                    let (fours, rest) = line.as_chunks_mut::<CELL>();
                    let whole = fours.len();
                    let values = phases[0]
                        .iter()
                        .zip(phases[1])
                        .zip(phases[2].iter().zip(phases[3]));
                    for (four, ((a, b), (c, d))) in fours.iter_mut().zip(values) {
                        *four = [*a, *b, *c, *d];
                    }
                    rest.iter_mut()
                        .zip(&phases)
                        .for_each(|(pixel, phase)| *pixel = phase[whole]);
                }
                begin += slots;
            }
        }
    }
}

/// Size of the parts, at most `most`, into which `count` is divided as evenly as possible.
fn evenly(count: usize, most: usize) -> usize {
    let parts = count.div_ceil(most.max(1)).max(1);
    count.div_ceil(parts).max(1)
}

/// Transforms the image along six rows of values at a time.
struct OfImage<'a> {
    rows: [&'a [f32]; SIDE],
    targets: [&'a mut [f32]; SIDE],
}

impl WithSimd for OfImage<'_> {
    type Output = ();

    #[inline(always)]
    #[allow(clippy::needless_range_loop, reason = "six rows at a time")]
    fn with_simd<S: Simd>(self, simd: S) {
        let [a, b, c, d, e, f] = self.rows.map(|row| S::as_simd_f32s(row).0);
        let count = a.len();
        let (b, c, d, e, f) = (&b[..count], &c[..count], &d[..count], &e[..count], &f[..count]);
        let [u, v, w, x, y, z] = self.targets.map(|row| {
            let (wide, _) = S::as_mut_simd_f32s(row);
            &mut wide[..count]
        });
        let number = |value: f32| simd.splat_f32s(value);
        let (two, four, less_four, less_five) = (number(2.0), number(4.0), number(-4.0), number(-5.0));
        for at in 0..count {
            let (a, b, c, d, e, f) = (a[at], b[at], c[at], d[at], e[at], f[at]);
            let (even, odd) = (
                simd.mul_add_e_f32s(less_four, c, e),
                simd.mul_add_e_f32s(less_four, b, d),
            );
            let (far, far_odd) = (simd.sub_f32s(e, c), simd.mul_f32s(two, simd.sub_f32s(d, b)));
            u[at] = simd.mul_add_e_f32s(four, a, simd.mul_add_e_f32s(less_five, c, e));
            v[at] = simd.add_f32s(even, odd);
            w[at] = simd.sub_f32s(even, odd);
            x[at] = simd.add_f32s(far, far_odd);
            y[at] = simd.sub_f32s(far, far_odd);
            z[at] = simd.mul_add_e_f32s(four, b, simd.mul_add_e_f32s(less_five, d, f));
        }
    }
}

/// Transforms the result back along six rows of values at a time and adds a constant.
struct OfResult<'a> {
    rows: [&'a [f32]; SIDE],
    targets: [&'a mut [f32]; CELL],
    constant: f32,
}

impl WithSimd for OfResult<'_> {
    type Output = ();

    #[inline(always)]
    #[allow(clippy::needless_range_loop, reason = "six rows at a time")]
    fn with_simd<S: Simd>(self, simd: S) {
        let [a, b, c, d, e, f] = self.rows.map(|row| S::as_simd_f32s(row).0);
        let count = a.len();
        let (b, c, d, e, f) = (&b[..count], &c[..count], &d[..count], &e[..count], &f[..count]);
        let [u, v, w, x] = self.targets.map(|row| {
            let (wide, _) = S::as_mut_simd_f32s(row);
            &mut wide[..count]
        });
        let number = |value: f32| simd.splat_f32s(value);
        let (constant, two, four, eight) = (number(self.constant), number(2.0), number(4.0), number(8.0));
        for at in 0..count {
            let (a, f) = (simd.add_f32s(a[at], constant), simd.add_f32s(f[at], constant));
            let (near, near_odd) = (simd.add_f32s(b[at], c[at]), simd.sub_f32s(b[at], c[at]));
            let (far, far_odd) = (simd.add_f32s(d[at], e[at]), simd.sub_f32s(d[at], e[at]));
            u[at] = simd.add_f32s(a, simd.add_f32s(near, far));
            v[at] = simd.add_f32s(constant, simd.mul_add_e_f32s(two, far_odd, near_odd));
            w[at] = simd.add_f32s(constant, simd.mul_add_e_f32s(four, far, near));
            x[at] = simd.add_f32s(f, simd.mul_add_e_f32s(eight, far_odd, near_odd));
        }
    }
}

/// Transforms one input. `lines`: row in the cell, column modulo four, cell; `transformed`: room for as many;
/// `seen`: place, input, cell.
fn transform_image(
    lines: &[f32],
    transformed: &mut [f32],
    seen: &mut [f32],
    [input, inputs, cells]: [usize; 3],
) {
    let arch = Arch::new();
    let length = CELL * (cells + LANES);
    arch.dispatch(OfImage {
        rows: parts(lines, length),
        targets: parts_mut(transformed, length),
    });
    for (lines, seen) in transformed
        .chunks(length)
        .zip(seen.chunks_mut(SIDE * inputs * cells))
    {
        let column = |at: usize| &lines[at % CELL * (cells + LANES) + at / CELL..][..cells];
        let targets = parts_mut(seen, inputs * cells).map(|place| &mut place[input * cells..][..cells]);
        arch.dispatch(OfImage {
            rows: [0, 1, 2, 3, 4, 5].map(column),
            targets,
        });
    }
}

/// Transforms one output back. `made`: place, output, cell; `halves`: room for what is transformed along
/// columns only: place along the row, row in the cell, cell; `pixels`: row and column in the cell, cell.
fn transform_result(
    made: &[f32],
    [output, outputs, cells]: [usize; 3],
    constant: f32,
    halves: &mut [f32],
    pixels: &mut [f32],
) {
    let arch = Arch::new();
    let place =
        |row: usize, column: usize| &made[((row * SIDE + column) * outputs + output) * cells..][..cells];
    for (column, half) in halves.chunks_mut(CELL * cells).enumerate() {
        arch.dispatch(OfResult {
            rows: [0, 1, 2, 3, 4, 5].map(|row| place(row, column)),
            targets: parts_mut(half, cells),
            constant: 0.0,
        });
    }
    for (row, line) in pixels.chunks_mut(CELL * cells).enumerate() {
        arch.dispatch(OfResult {
            rows: [0, 1, 2, 3, 4, 5].map(|column| &halves[(column * CELL + row) * cells..][..cells]),
            targets: parts_mut(line, cells),
            constant,
        });
    }
}

/// The first parts of a slice.
fn parts<const COUNT: usize>(values: &[f32], length: usize) -> [&[f32]; COUNT] {
    let mut rest = values.chunks(length);
    std::array::from_fn(|_| rest.next().unwrap_or_default())
}

/// The first parts of a slice.
fn parts_mut<const COUNT: usize>(values: &mut [f32], length: usize) -> [&mut [f32]; COUNT] {
    let mut rest = values.chunks_mut(length);
    std::array::from_fn(|_| rest.next().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pseudo-random values between -1 and 1.
    fn noise(count: usize, seed: u32) -> Vec<f32> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1u32 << 23) - 1.0
        };
        (0..count).map(|_| next() as f32).collect()
    }

    /// The definition, in double precision.
    fn by_definition(x: &[f32], weight: &[f32], bias: &[f32], g: &Geometry) -> Vec<f64> {
        let mut y = Vec::new();
        for image in 0..g.batch {
            for output in 0..g.outputs {
                for place in 0..g.rows * g.columns {
                    let (row, column) = (place / g.columns, place % g.columns);
                    let mut sum = f64::from(bias[output]);
                    for input in 0..g.inputs {
                        for tap in 0..9 {
                            let (at, along) = (row + tap / 3, column + tap % 3);
                            if (1..=g.rows).contains(&at) && (1..=g.columns).contains(&along) {
                                let plane = (image * g.inputs + input) * g.rows;
                                let pixel = x[(plane + at - 1) * g.columns + along - 1];
                                let weight = weight[(output * g.inputs + input) * 9 + tap];
                                sum += f64::from(pixel) * f64::from(weight);
                            }
                        }
                    }
                    y.push(sum);
                }
            }
        }
        y
    }

    fn geometry([batch, inputs, rows, columns, outputs]: [usize; 5]) -> Geometry {
        Geometry {
            batch,
            inputs,
            rows,
            columns,
            outputs,
            size: 3,
            stride: 1,
            is_same: false,
        }
    }

    #[test]
    fn agrees_with_the_definition() {
        let cases = [
            [1, 3, 8, 8, 4],
            // Sides that cells do not fill.
            [2, 3, 7, 10, 4],
            [1, 2, 1, 1, 1],
            [1, 1, 2, 3, 2],
            // Several blocks of an image; several images of a block, the last one less full.
            [1, 2, 45, 61, 3],
            [9, 5, 14, 14, 6],
        ];
        for case in cases {
            let g = geometry(case);
            let x = noise(g.input_shape().iter().product(), 1);
            let weight = noise(g.weight_shape().iter().product(), 2);
            let bias = noise(g.outputs, 3);
            let found = forward(&x, &Filters::new(&weight), Some(&bias), &g);
            let truth = by_definition(&x, &weight, &bias, &g);
            assert_eq!(found.len(), truth.len());
            for (found, truth) in found.iter().zip(&truth) {
                assert!(
                    (f64::from(*found) - truth).abs() < 1e-4,
                    "{case:?}: {found} {truth}"
                );
            }
        }
    }

    #[test]
    fn threads_make_no_difference() {
        let g = geometry([3, 4, 45, 61, 3]);
        let x = noise(g.input_shape().iter().product(), 4);
        let filters = Filters::new(&noise(g.weight_shape().iter().product(), 5));
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| forward(&x, &filters, None, &g))
        };
        assert_eq!(with(1), with(3));
    }
}
