//! Products of sparse and dense matrices.

use crate::engine::sparse::SparseMatrix;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Rows that one thread takes at a time.
const ROWS_AT_ONCE: usize = 64;

/// The product of a sparse matrix and a dense one of `columns` columns, row by row.
pub fn forward(matrix: &SparseMatrix, dense: &[f32], columns: usize) -> Vec<f32> {
    let mut product = vec![0.0f32; matrix.rows() * columns];
    let rows = product
        .par_chunks_mut(columns.max(1))
        .with_min_len(ROWS_AT_ONCE)
        .enumerate();
    let arch = Arch::new();
    rows.for_each(|(row, sums)| {
        arch.dispatch(Row {
            entries: matrix.row(row),
            dense,
            sums,
        });
    });
    product
}

/// A row of the product. The loop is compiled for the widest vectors of the processor.
struct Row<'a> {
    entries: &'a [(u32, f32)],
    dense: &'a [f32],
    sums: &'a mut [f32],
}

impl WithSimd for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let columns = self.sums.len();
        for &(column, weight) in self.entries {
            let source = &self.dense[column as usize * columns..][..columns];
            for (sum, value) in self.sums.iter_mut().zip(source) {
                *sum += weight * value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_product_agrees_with_its_definition() {
        let mut matrix = SparseMatrix::new(5);
        for row in 0..7u32 {
            // Rows of 0 to 3 entries, one column twice.
            let entries = (0..row % 4).map(|i| ((row * 3 + i * i) % 5, 0.5 + i as f32 - row as f32));
            matrix.push_row(entries.chain((row == 6).then_some((2, 0.25))));
        }
        let values: Vec<f32> = (0..15).map(|i| (i as f32 * 0.7).sin()).collect();
        let mut expected = vec![0.0f32; 7 * 3];
        for row in 0..7 {
            for &(column, weight) in matrix.row(row) {
                for channel in 0..3 {
                    expected[row * 3 + channel] += weight * values[column as usize * 3 + channel];
                }
            }
        }
        let product = forward(&matrix, &values, 3);
        assert!(product.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-5));
    }
}
