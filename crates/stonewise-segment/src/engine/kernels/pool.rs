//! The largest of neighbouring pixels, on slices: plane, row, column.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Max pooling over 3 x 3 pixels with stride 2 and a border of 1, of planes of `rows` x `columns`.
pub fn halve(x: &[f32], [rows, columns]: [usize; 2]) -> Vec<f32> {
    let size = [rows, columns].map(|side| side.div_ceil(2));
    let planes = x.len() / (rows * columns).max(1);
    let mut y = vec![0.0f32; planes * size[0] * size[1]];
    let targets = y.par_chunks_mut((size[0] * size[1]).max(1));
    let sources = x.par_chunks((rows * columns).max(1));
    targets.zip(sources).for_each_init(Vec::new, |line, (y, x)| {
        line.resize(columns, 0.0);
        for (row, y) in y.chunks_mut(size[1]).enumerate() {
            let source = |row: usize| &x[row * columns..][..columns];
            let [middle, below] = [2 * row, (2 * row + 1).min(rows - 1)].map(source);
            let above = source((2 * row).saturating_sub(1));
            Arch::new().dispatch(Row {
                rows: [above, middle, below],
                line,
                y,
            });
        }
    });
    y
}

/// A row of the result. The loops are compiled for the widest vectors of the processor.
struct Row<'a> {
    /// The rows that it is computed from.
    rows: [&'a [f32]; 3],
    /// Memory for the largest of each column.
    line: &'a mut [f32],
    y: &'a mut [f32],
}

impl WithSimd for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let [above, middle, below] = self.rows;
        let rows = above.iter().zip(middle).zip(below);
        for (to, ((a, b), c)) in self.line.iter_mut().zip(rows) {
            *to = larger(larger(*a, *b), *c);
        }
        halve_line(self.line, self.y);
    }
}

/// Derivative with regard to the values, from that with regard to the result: it belongs to the largest, to
/// the first where several are.
pub fn backward(x: &[f32], grad: &[f32], [rows, columns]: [usize; 2]) -> Vec<f32> {
    let size = [rows, columns].map(|side| side.div_ceil(2));
    let mut x_grad = vec![0.0f32; x.len()];
    let targets = x_grad.par_chunks_mut((rows * columns).max(1));
    let sources = x.par_chunks((rows * columns).max(1));
    let grads = grad.par_chunks((size[0] * size[1]).max(1));
    targets.zip(sources).zip(grads).for_each(|((x_grad, x), grad)| {
        for (place, grad) in grad.iter().enumerate() {
            let [row, column] = [place / size[1], place % size[1]];
            x_grad[largest(x, [row, column], [rows, columns])] += grad;
        }
    });
    x_grad
}

/// Where the largest value around a pixel of the result lies, the first of equal ones.
fn largest(x: &[f32], [row, column]: [usize; 2], [rows, columns]: [usize; 2]) -> usize {
    let around = |at: usize, side: usize| (2 * at).saturating_sub(1)..=(2 * at + 1).min(side - 1);
    let mut best = 2 * row * columns + 2 * column;
    let mut most = f32::NEG_INFINITY;
    for y in around(row, rows) {
        for place in around(column, columns).map(|x| y * columns + x) {
            if x[place] > most {
                (best, most) = (place, x[place]);
            }
        }
    }
    best
}

/// The largest of three values around every second one.
#[inline(always)]
fn halve_line(line: &[f32], y: &mut [f32]) {
    let (pairs, last) = line.as_chunks::<2>();
    for (to, [a, b]) in y.iter_mut().zip(pairs) {
        *to = larger(*a, *b);
    }
    if let (Some(to), Some(value)) = (y.get_mut(pairs.len()), last.first()) {
        *to = *value;
    }
    for (to, [_, before]) in y.iter_mut().skip(1).zip(pairs) {
        *to = larger(*to, *before);
    }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_neighbours_agree_with_the_definition() {
        for [planes, rows, columns] in [[1usize, 1, 1], [6, 6, 8], [2, 7, 33], [1, 2, 5]] {
            let x: Vec<f32> = (0..planes * rows * columns)
                .map(|i| (i as f32 * 0.7).sin())
                .collect();
            let size = [rows, columns].map(|side| side.div_ceil(2));
            let y = halve(&x, [rows, columns]);
            assert_eq!(y.len(), planes * size[0] * size[1]);
            for (place, value) in y.into_iter().enumerate() {
                let [column, row, plane] = [
                    place % size[1],
                    place / size[1] % size[0],
                    place / size[1] / size[0],
                ];
                let near = |at: usize, of: usize| at.abs_diff(2 * of) <= 1;
                let seen =
                    (0..rows * columns).filter(|i| near(i / columns, row) && near(i % columns, column));
                let most = seen
                    .map(|i| x[plane * rows * columns + i])
                    .fold(f32::MIN, f32::max);
                assert_eq!(value, most);
            }
        }
    }
}
