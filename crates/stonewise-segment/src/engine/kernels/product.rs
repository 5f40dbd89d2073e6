//! Products of matrices.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Rows of the result that a thread computes at a time.
const ROWS_AT_ONCE: usize = 64;

/// The product of two matrices, row by row.
pub fn product(a: MatRef<f32>, b: MatRef<f32>) -> Vec<f32> {
    let columns = b.ncols();
    let mut y = vec![0.0f32; a.nrows() * columns];
    let parts = y.par_chunks_mut((ROWS_AT_ONCE * columns).max(1)).enumerate();
    parts.for_each(|(part, y)| {
        let rows = y.len() / columns;
        let some = a.subrows(part * ROWS_AT_ONCE, rows);
        let target = MatMut::from_row_major_slice_mut(y, rows, columns);
        matmul(target, Accum::Replace, some, b, 1.0, Par::Seq);
    });
    y
}
